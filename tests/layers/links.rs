//! Checks that what the documents link to exists: files, and headings within them.

use std::path::{Path, PathBuf};

use crate::root;

fn documents(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy();
        if path.is_dir() && !name.starts_with('.') && name != "target" && name != "saves" {
            documents(&path, found);
        } else if name.ends_with(".md") {
            found.push(path);
        }
    }
}

/// Returns the text without blocks of code.
fn prose(path: &Path) -> String {
    let text = std::fs::read_to_string(path).unwrap();
    text.split("```").step_by(2).collect()
}

/// Returns the places that links can name, as GitHub derives them from headings.
fn places(path: &Path) -> Vec<String> {
    let text = prose(path);
    let headings = text.lines().filter(|line| line.starts_with('#'));
    let place = |heading: &str| {
        let words = heading.trim_start_matches('#').trim().to_lowercase();
        let kept = words.chars().filter(|c| c.is_alphanumeric() || "-_ ".contains(*c));
        kept.map(|c| if c == ' ' { '-' } else { c }).collect()
    };
    headings.map(place).collect()
}

#[test]
fn documents_link_to_what_there_is() {
    let mut found = Vec::new();
    documents(root(), &mut found);
    let (mut broken, mut checked) = (Vec::new(), 0);
    for document in found {
        let text = prose(&document);
        let links = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
        for link in links.filter(|link| !link.contains("://")) {
            checked += 1;
            let (file, place) = link.split_once('#').unwrap_or((link, ""));
            let folder = document.parent().unwrap();
            let target = if file.is_empty() { document.clone() } else { folder.join(file) };
            let is_there = target.exists()
                && (place.is_empty() || places(&target).iter().any(|other| other == place));
            if !is_there {
                broken.push(format!("{}: {link}", document.display()));
            }
        }
    }
    assert!(checked > 100, "only {checked} links were found");
    assert!(broken.is_empty(), "{broken:#?}");
}

/// Returns the texts of all files of Rust below `folder`.
fn sources(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let texts = entries.map(|path| match path.extension() {
        _ if path.is_dir() => sources(&path),
        Some(end) if end == "rs" => vec![std::fs::read_to_string(&path).unwrap()],
        _ => Vec::new(),
    });
    texts.flatten().collect()
}

#[test]
fn the_page_of_failures_names_tests_and_files_that_there_are() {
    let code = ["src", "crates", "tests"].map(|folder| sources(&root().join(folder))).concat();
    let page = std::fs::read_to_string(root().join("docs/reliability.md")).unwrap();
    let (mut missing, mut checked) = (Vec::new(), 0);
    for name in page.split('`').skip(1).step_by(2) {
        let name = name.rsplit("::").next().unwrap();
        let is_file =
            name.contains('/') && Path::new(name).extension().is_some_and(|end| end == "rs");
        let is_there = if is_file {
            root().join(name).exists()
        } else if name.matches('_').count() > 1 && !name.contains(' ') {
            let test = name
                .strip_suffix("...")
                .map_or(format!("fn {name}("), |start| format!("fn {start}"));
            code.iter().any(|text| text.contains(&test))
        } else {
            continue;
        };
        checked += 1;
        missing.extend((!is_there).then_some(name));
    }
    assert!(checked > 100, "only {checked} names were found");
    assert!(missing.is_empty(), "{missing:#?}");
}
