//! What commands write: to files, or to standard output by the name `-`.

use std::path::Path;

use super::Stop;
use super::inputs::unwritable;
use crate::shell::console::print_line;
use crate::shell::fault::{Fault, FaultKind};

/// Whether a name is that of standard output.
pub(super) fn is_printed(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// Whether one of the options, each with the file that it names, is for standard output. That then holds nothing else, no summary either.
///
/// # Errors
/// [`FaultKind::Senseless`] if several are.
pub(super) fn one_is_printed<const N: usize>(options: [(&str, Option<&Path>); N]) -> Result<bool, Fault> {
    let printed = options.into_iter().filter(|(_, path)| path.is_some_and(is_printed));
    let names: Vec<&str> = printed.map(|(option, _)| option).collect();
    if names.len() > 1 {
        let detail = format!("{}: only one of them can go to standard output", names.join(", "));
        return Err(Fault::new(FaultKind::Senseless, detail));
    }
    Ok(!names.is_empty())
}

/// Writes a text, in place of what was there.
///
/// # Errors
/// If it cannot be written, or nobody reads on.
pub(super) fn write(path: &Path, text: &str) -> Result<(), Stop> {
    if is_printed(path) {
        return Ok(print_line(text.trim_end())?);
    }
    Ok(std::fs::write(path, text).map_err(|error| unwritable(path, &error))?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standard_output_is_for_one() {
        let printed = |json: Option<&str>, report: Option<&str>| {
            one_is_printed([("--json", json.map(Path::new)), ("--report", report.map(Path::new))])
        };
        assert_eq!(printed(None, None), Ok(false));
        assert_eq!(printed(Some("a.json"), Some("-.html")), Ok(false));
        assert_eq!(printed(Some("-"), Some("a.html")), Ok(true));
        assert_eq!(printed(None, Some("-")), Ok(true));
        let fault = printed(Some("-"), Some("-")).expect_err("two");
        assert!(fault.detail.starts_with("--json, --report: "), "{fault}");
    }
}
