//! Reads a crate's modules, what each defines, and where the paths in its code lead.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use proc_macro2::{TokenStream, TokenTree};
use syn::visit::{self, Visit};
use syn::{Attribute, Item, UseTree};

/// Name of a module, from the crate's root: empty for the root itself.
pub type Name = Vec<String>;

/// A module in a file of its own.
#[derive(Default)]
pub struct Module {
    pub file: PathBuf,
    children: BTreeSet<String>,
    definitions: BTreeSet<String>,
    /// Imported names and their paths.
    imports: Vec<(String, Vec<String>)>,
    globs: Vec<Vec<String>>,
    /// All paths in its code but for tests.
    paths: BTreeSet<Vec<String>>,
}

/// The modules of a crate.
pub struct Crate(pub BTreeMap<Name, Module>);

impl Crate {
    /// Reads the crate whose root is `src/lib.rs` and, if there is one, its `main.rs`.
    pub fn read(src: &Path) -> Self {
        let mut modules = Self(BTreeMap::new());
        modules.add(&src.join("lib.rs"), Vec::new(), src);
        modules
    }

    fn add(&mut self, file: &Path, name: Name, folder: &Path) {
        let text =
            std::fs::read_to_string(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        let syntax = syn::parse_file(&text).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        let mut module = Module { file: file.to_owned(), ..Module::default() };
        for item in &syntax.items {
            if let Item::Mod(inner) = item
                && inner.content.is_none()
                && !is_test(&inner.attrs)
            {
                let child = inner.ident.to_string();
                module.children.insert(child.clone());
                let name = name.iter().cloned().chain([child.clone()]).collect();
                self.add(&folder.join(format!("{child}.rs")), name, &folder.join(child));
            }
            module.definitions.extend(defined(item));
        }
        module.visit_file(&syntax);
        self.0.insert(name, module);
    }

    /// Returns the modules whose definitions each module uses, and by which paths.
    pub fn arrows(&self) -> BTreeMap<(Name, Name), Vec<String>> {
        let mut arrows: BTreeMap<_, Vec<_>> = BTreeMap::new();
        for (name, module) in &self.0 {
            for path in &module.paths {
                if let Some(to) = self.resolve(name, path, 0).filter(|to| to != name) {
                    arrows.entry((name.clone(), to)).or_default().push(path.join("::"));
                }
            }
        }
        arrows
    }

    /// Returns the module that defines what `path` means in the module `from`; `None` for other
    /// crates.
    fn resolve(&self, from: &Name, path: &[String], depth: usize) -> Option<Name> {
        // A re-export of a re-export ...
        const MAX_DEPTH: usize = 12;
        let mut at = from.clone();
        let mut rest = path;
        match path.first()?.as_str() {
            _ if depth > MAX_DEPTH => return None,
            "crate" => (at, rest) = (Vec::new(), &path[1..]),
            "self" => rest = &path[1..],
            _ => {
                while rest.first().is_some_and(|part| part == "super") {
                    at.pop();
                    rest = &rest[1..];
                }
            }
        }
        let is_relative = rest.len() == path.len();
        while let Some((part, after)) = rest.split_first() {
            let module = self.0.get(&at)?;
            if module.children.contains(part) {
                at.push(part.clone());
                rest = after;
                continue;
            }
            if module.definitions.contains(part) {
                return Some(at);
            }
            // The import of a crate's own name leads nowhere.
            let import = module
                .imports
                .iter()
                .find(|(name, to)| name == part && !(is_relative && to == rest));
            let continued = |to: &[String], after: &[String]| {
                let path: Vec<String> = to.iter().chain(after).cloned().collect();
                self.resolve(&at, &path, depth + 1)
            };
            return match import {
                Some((_, to)) => continued(to, after),
                None => module.globs.iter().find_map(|to| continued(to, rest)),
            };
        }
        (at != *from).then_some(at)
    }
}

/// Returns the name that an item defines; for the call of a macro, what it calls a struct.
fn defined(item: &Item) -> Option<String> {
    let name = match item {
        Item::Macro(item) if item.ident.is_none() => {
            let mut tokens = item.mac.tokens.clone().into_iter().map(|token| token.to_string());
            tokens.find(|token| token == "struct")?;
            return tokens.next();
        }
        Item::Const(item) => &item.ident,
        Item::Enum(item) => &item.ident,
        Item::Fn(item) => &item.sig.ident,
        Item::Macro(item) => item.ident.as_ref()?,
        Item::Static(item) => &item.ident,
        Item::Struct(item) => &item.ident,
        Item::Trait(item) => &item.ident,
        Item::Type(item) => &item.ident,
        _ => return None,
    };
    Some(name.to_string())
}

/// Whether an item is compiled for tests alone.
fn is_test(attributes: &[Attribute]) -> bool {
    let mut conditions = attributes.iter().filter(|attribute| attribute.path().is_ident("cfg"));
    conditions.any(|condition| {
        let syn::Meta::List(list) = &condition.meta else { return false };
        let words = list.tokens.to_string();
        let mut words = words.split(|c: char| !c.is_alphanumeric() && c != '_');
        !list.tokens.to_string().contains("not") && words.any(|word| word == "test")
    })
}

impl Module {
    /// Adds the paths of a `use` declaration.
    fn add_import(&mut self, tree: &UseTree, prefix: &[String]) {
        let extended = |part: &syn::Ident| {
            prefix.iter().cloned().chain([part.to_string()]).collect::<Vec<_>>()
        };
        let mut add = |name: String, path: Vec<String>| {
            self.paths.insert(path.clone());
            self.imports.push((name, path));
        };
        match tree {
            UseTree::Path(path) => self.add_import(&path.tree, &extended(&path.ident)),
            UseTree::Group(group) => {
                group.items.iter().for_each(|tree| self.add_import(tree, prefix));
            }
            UseTree::Glob(_) => self.globs.push(prefix.to_vec()),
            UseTree::Name(name) if name.ident == "self" => {
                add(prefix.last().cloned().unwrap_or_default(), prefix.to_vec());
            }
            UseTree::Name(name) => add(name.ident.to_string(), extended(&name.ident)),
            UseTree::Rename(name) => add(name.rename.to_string(), extended(&name.ident)),
        }
    }

    /// Adds the paths among the arguments of a macro.
    fn add_tokens(&mut self, tokens: TokenStream) {
        let (mut path, mut colons) = (Vec::new(), 0);
        for token in tokens {
            match token {
                TokenTree::Ident(part) if colons == 2 => path.push(part.to_string()),
                TokenTree::Ident(part) => {
                    self.paths.insert(std::mem::replace(&mut path, vec![part.to_string()]));
                }
                TokenTree::Punct(mark) if mark.as_char() == ':' => {
                    colons += 1;
                    continue;
                }
                TokenTree::Group(group) => self.add_tokens(group.stream()),
                _ => {
                    self.paths.insert(std::mem::take(&mut path));
                }
            }
            colons = 0;
        }
        self.paths.insert(path);
    }
}

impl<'a> Visit<'a> for Module {
    fn visit_path(&mut self, path: &'a syn::Path) {
        self.paths.insert(path.segments.iter().map(|part| part.ident.to_string()).collect());
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, found: &'a syn::Macro) {
        self.visit_path(&found.path);
        self.add_tokens(found.tokens.clone());
    }

    fn visit_item_use(&mut self, item: &'a syn::ItemUse) {
        self.add_import(&item.tree, &[]);
    }

    // `pub(super)` and `pub(in path)` use nothing.
    fn visit_visibility(&mut self, _: &'a syn::Visibility) {}

    fn visit_item_mod(&mut self, item: &'a syn::ItemMod) {
        if !is_test(&item.attrs) {
            visit::visit_item_mod(self, item);
        }
    }

    fn visit_item_fn(&mut self, item: &'a syn::ItemFn) {
        if !is_test(&item.attrs) {
            visit::visit_item_fn(self, item);
        }
    }

    fn visit_impl_item_fn(&mut self, item: &'a syn::ImplItemFn) {
        if !is_test(&item.attrs) {
            visit::visit_impl_item_fn(self, item);
        }
    }
}
