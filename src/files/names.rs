//! What the names of files say.

use std::path::Path;

/// Returns whether a file has this extension, in capitals or not.
pub fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|own| own.eq_ignore_ascii_case(extension))
}

/// Returns whether a file is hidden: macOS puts a `._NAME` beside every `NAME` on file systems of others.
pub fn is_hidden(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extensions_may_be_in_capitals_and_hidden_files_begin_with_a_dot() {
        assert!(has_extension(Path::new("A.MAP"), "map") && has_extension(Path::new("a.b.map"), "map"));
        assert!(!has_extension(Path::new("map"), "map") && !has_extension(Path::new("a.map.txt"), "map"));
        assert!(is_hidden(Path::new("maps/._a.map")) && !is_hidden(Path::new("./a.map")));
        assert!(!is_hidden(Path::new("..")), "a folder above is no hidden file");
    }
}
