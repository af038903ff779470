//! Modules of a crate, and the paths by which they name each other.

use proc_macro2::{Ident, TokenStream, TokenTree};
use std::collections::BTreeMap;
use syn::visit::{self, Visit};

use super::syntax::{self, is_test};

/// Modules from the root of the crate: `["rt", "haptic"]`.
pub type ModulePath = Vec<String>;

#[derive(Debug)]
pub struct Reference {
    pub from: ModulePath,
    /// Path from the root of the crate; modules first, then items.
    pub to: ModulePath,
    pub file: String,
    pub line: usize,
    /// Name that an import binds in `from`; `None` for a path within an expression.
    pub binds: Option<String>,
}

#[derive(Debug, Default)]
pub struct Crate {
    /// Names of the modules within each module.
    pub children: BTreeMap<ModulePath, Vec<String>>,
    pub references: Vec<Reference>,
}

/// Reads a crate from its root file, following its `mod` items.
pub fn read_crate(root: &str, read: &dyn Fn(&str) -> Option<String>) -> Crate {
    let mut found = Crate::default();
    found.children.insert(Vec::new(), Vec::new());
    Reader {
        file: root.to_string(),
        folder: root.rsplit_once('/').map_or("", |(folder, _)| folder).to_string(),
        module: Vec::new(),
        read,
        found: &mut found,
    }
    .read_file();
    found
}

/// One module, while it is read.
struct Reader<'a> {
    file: String,
    folder: String,
    module: ModulePath,
    read: &'a dyn Fn(&str) -> Option<String>,
    found: &'a mut Crate,
}

impl Reader<'_> {
    fn read_file(&mut self) {
        if let Some(source) = (self.read)(&self.file) {
            self.visit_file(&syntax::parse(&self.file, &source));
        }
    }

    /// Calls [`push`](Self::push) with every leaf of a use tree.
    fn read_use(&mut self, tree: &syn::UseTree, mut path: Vec<Ident>) {
        let binds = match tree {
            syn::UseTree::Path(part) => {
                path.push(part.ident.clone());
                return self.read_use(&part.tree, path);
            }
            syn::UseTree::Group(group) => {
                return group.items.iter().for_each(|part| self.read_use(part, path.clone()));
            }
            syn::UseTree::Name(name) => {
                path.push(name.ident.clone());
                // `a::{self}` binds `a`.
                path.iter().rfind(|part| *part != "self").map(Ident::to_string)
            }
            syn::UseTree::Rename(rename) => {
                path.push(rename.ident.clone());
                Some(rename.rename.to_string())
            }
            syn::UseTree::Glob(_) => Some("*".to_string()),
        };
        self.push(&path, binds);
    }

    /// Keeps a path within an expression or a type, where it is one of this crate.
    fn name(&mut self, path: &[Ident]) {
        if path.len() > 1 && is_root(&path[0]) {
            self.push(path, None);
        }
    }

    fn push(&mut self, path: &[Ident], binds: Option<String>) {
        let Some(last) = path.last() else { return };
        let mut to = match path[0] == "crate" {
            true => Vec::new(),
            // A bare name may be a child or another crate: the graph drops what is no module.
            false => self.module.clone(),
        };
        for part in path.iter().map(Ident::to_string) {
            match part.as_str() {
                "crate" | "self" => {}
                "super" => {
                    to.pop();
                }
                _ => to.push(part),
            }
        }
        self.found.references.push(Reference {
            from: self.module.clone(),
            to,
            file: self.file.clone(),
            line: last.span().start().line,
            binds,
        });
    }

    /// Keeps the paths among what a macro is given.
    fn read_tokens(&mut self, tokens: TokenStream) {
        let (mut path, mut colons) = (Vec::new(), 0);
        for tree in tokens {
            match tree {
                TokenTree::Punct(mark) if mark.as_char() == ':' => colons += 1,
                TokenTree::Ident(part) if colons == 2 => {
                    path.push(part);
                    colons = 0;
                }
                other => {
                    self.name(&std::mem::take(&mut path));
                    colons = 0;
                    match other {
                        TokenTree::Ident(first) => path.push(first),
                        TokenTree::Group(group) => self.read_tokens(group.stream()),
                        _ => {}
                    }
                }
            }
        }
        self.name(&path);
    }
}

fn is_root(name: &Ident) -> bool {
    name == "crate" || name == "super" || name == "self"
}

/// Methods of a visitor that pass over what only tests compile.
macro_rules! skip_tests {
    ($($method:ident $node:ident),*) => {
        $(fn $method(&mut self, node: &'ast syn::$node) {
            if !is_test(&node.attrs) {
                visit::$method(self, node);
            }
        })*
    };
}

impl<'ast> Visit<'ast> for Reader<'_> {
    skip_tests!(
        visit_item_fn ItemFn, visit_item_impl ItemImpl, visit_item_struct ItemStruct, visit_item_enum ItemEnum,
        visit_item_const ItemConst, visit_item_static ItemStatic, visit_item_type ItemType, visit_item_trait ItemTrait,
        visit_item_macro ItemMacro, visit_impl_item_fn ImplItemFn, visit_impl_item_const ImplItemConst,
        visit_trait_item_fn TraitItemFn, visit_field Field, visit_variant Variant, visit_field_value FieldValue,
        visit_arm Arm, visit_local Local, visit_stmt_macro StmtMacro, visit_expr_block ExprBlock
    );

    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        if is_test(&item.attrs) {
            return;
        }
        let name = item.ident.to_string();
        let module: ModulePath = self.module.iter().chain([&name]).cloned().collect();
        self.found.children.insert(module.clone(), Vec::new());
        let siblings = self.found.children.entry(self.module.clone()).or_default();
        siblings.push(name.clone());
        let files = [
            format!("{}/{name}.rs", self.folder),
            format!("{}/{name}/mod.rs", self.folder),
        ];
        let mut inner = Reader {
            file: self.file.clone(),
            folder: format!("{}/{name}", self.folder),
            module,
            read: self.read,
            found: &mut *self.found,
        };
        match &item.content {
            Some((_, items)) => items.iter().for_each(|item| inner.visit_item(item)),
            None => {
                for file in files {
                    inner.file = file;
                    inner.read_file();
                }
            }
        }
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        if !is_test(&item.attrs) {
            self.read_use(&item.tree, Vec::new());
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let names: Vec<Ident> = path.segments.iter().map(|part| part.ident.clone()).collect();
        self.name(&names);
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, call: &'ast syn::Macro) {
        self.visit_path(&call.path);
        self.read_tokens(call.tokens.clone());
    }

    fn visit_attribute(&mut self, attribute: &'ast syn::Attribute) {
        if let syn::Meta::List(list) = &attribute.meta {
            self.read_tokens(list.tokens.clone());
        }
    }

    /// Ignores the path of `pub(in crate::a)`, which imports nothing.
    fn visit_vis_restricted(&mut self, _: &'ast syn::VisRestricted) {}
}
