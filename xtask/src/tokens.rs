//! Words and signs of Rust code, and where items of it end: enough of a parser to find names.

pub(crate) fn is_word(token: &str) -> bool {
    token.starts_with(|c: char| c == '_' || c.is_alphabetic())
}

/// Words, `::`, and all else by character.
pub(crate) fn tokens(code: &str) -> Vec<&str> {
    let (mut found, mut rest) = (Vec::new(), code);
    while let Some(first) = rest.chars().next() {
        let length = if first == '_' || first.is_alphanumeric() {
            rest.find(|c: char| !(c == '_' || c.is_alphanumeric())).unwrap_or(rest.len())
        } else if rest.starts_with("::") {
            2
        } else {
            first.len_utf8()
        };
        if !first.is_whitespace() {
            found.push(&rest[..length]);
        }
        rest = &rest[length..];
    }
    found
}

/// Behind the bracket that closes the first one at or after `from`.
pub(crate) fn closed(tokens: &[&str], from: usize) -> usize {
    let mut depth = 0_usize;
    for (i, token) in tokens.iter().enumerate().skip(from) {
        match *token {
            "(" | "[" | "{" => depth += 1,
            ")" | "]" | "}" if depth <= 1 => return i + 1,
            ")" | "]" | "}" => depth -= 1,
            _ => {}
        }
    }
    tokens.len()
}

/// Is this attribute `#[cfg(test)]`, or one that asks for more besides?
pub(crate) fn is_for_tests(attribute: &[&str]) -> bool {
    let has = |word| attribute.contains(&word);
    has("cfg") && has("test") && !has("not") && !has("any")
}

/// Behind the item that begins at `from`, or behind its other attributes and it.
pub(crate) fn item_end(tokens: &[&str], from: usize) -> usize {
    let (mut i, mut is_use, mut is_item) = (from, false, false);
    while let Some(token) = tokens.get(i) {
        match *token {
            "use" => (is_use, is_item) = (true, true),
            "fn" | "mod" | "impl" | "struct" | "enum" | "trait" | "type" | "const" | "static" => is_item = true,
            ";" => return i + 1,
            // Behind a field, a variant or an argument.
            "," if !is_item => return i + 1,
            "}" => return i,
            "{" if !is_use => return closed(tokens, i),
            "(" | "[" | "{" => {
                i = closed(tokens, i);
                continue;
            }
            _ => {}
        }
        i += 1;
    }
    i
}
