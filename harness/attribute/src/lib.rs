//! `#[test]` for programs whose `main` is `brickcast_harness::main`: the function stays as it is and its name goes into
//! the program's list.
//!
//! `#[macro_use] extern crate brickcast_harness_attribute` at the root puts it in place of the compiler's own, also for
//! macros that write `#[test]` (`proptest!`). It reads tokens by itself: all that it must know is which attributes
//! stand before `fn`, and the name behind.

use proc_macro::{TokenStream, TokenTree};

/// Lists a function without parameters and result as a test; `#[ignore]` is known, whatever else would be lost is
/// refused.
#[proc_macro_attribute]
pub fn test(_: TokenStream, item: TokenStream) -> TokenStream {
    listed(item).unwrap_or_else(|why| format!("compile_error!({why:?});").parse().unwrap_or_default())
}

fn listed(item: TokenStream) -> Result<TokenStream, &'static str> {
    let (mut function, mut is_ignored, mut has_runtime, mut name) = (TokenStream::new(), false, false, None);
    let mut tokens = item.into_iter();
    while let Some(token) = tokens.next() {
        match word(&token).as_deref() {
            Some("async") if !has_runtime => {
                return Err("an async test needs a runtime: #[test] #[tokio::main] async fn");
            }
            Some("fn") => {
                let named = tokens.next().ok_or("a name is expected behind `fn`")?;
                name = word(&named);
                function.extend([token, named]);
                function.extend(tokens);
                break;
            }
            _ => {}
        }
        // Attributes before the function: `#` and a group in brackets.
        let attribute = if matches!(&token, TokenTree::Punct(p) if p.as_char() == '#') { tokens.next() } else { None };
        let attribute_word = attribute.as_ref().and_then(first_word);
        has_runtime |= attribute_word.as_deref() == Some("tokio");
        match attribute_word.as_deref() {
            Some("ignore") => is_ignored = true,
            Some("should_panic") => return Err("#[should_panic] is not known here: use catch_unwind"),
            _ => function.extend([token].into_iter().chain(attribute)),
        }
    }
    let name = name.ok_or("#[test] stands before a function")?;
    let entry = format!(
        "::brickcast_harness::inventory::submit! {{ ::brickcast_harness::Test {{ \
         path: concat!(module_path!(), \"::\", stringify!({name})), is_ignored: {is_ignored}, run: {name} }} }}"
    );
    function.extend(entry.parse::<TokenStream>().map_err(|_| "a test's name is a plain word")?);
    Ok(function)
}

fn word(token: &TokenTree) -> Option<String> {
    if let TokenTree::Ident(word) = token { Some(word.to_string()) } else { None }
}

fn first_word(attribute: &TokenTree) -> Option<String> {
    let TokenTree::Group(group) = attribute else { return None };
    word(&group.stream().into_iter().next()?)
}
