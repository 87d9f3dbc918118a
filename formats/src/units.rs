//! Units of length by the names that programs give them.

/// The short name, and how many micrometres it is; nothing for what is no length (`pixel`).
pub(crate) fn length(name: &str) -> Option<(&'static str, f64)> {
    Some(match name.trim() {
        "nm" | "nanometer" | "nanometre" => ("nm", 1e-3),
        "um" | "µm" | "μm" | "micron" | "microns" | "micrometer" | "micrometre" | "\\u00B5m" | "\\u00b5m" => {
            ("um", 1.0)
        }
        "mm" | "millimeter" | "millimetre" => ("mm", 1e3),
        "cm" | "centimeter" | "centimetre" => ("cm", 1e4),
        "m" | "meter" | "metre" => ("m", 1e6),
        "inch" | "in" | "\"" => ("inch", 25_400.0),
        "Å" | "angstrom" => ("angstrom", 1e-4),
        "pm" => ("pm", 1e-6),
        _ => return None,
    })
}
