//! Circular imports among the modules of one folder, at every depth of a crate.
//!
//! A path from below module `a` to below its sibling `b` is an edge `a -> b`. Parents that name their children and
//! children that name items of their parent make no edges; an item that the parent imports counts as part of its
//! original sibling. Files of one folder may import each other; a circle counts if a folder is part of it, and always
//! at the root of a crate.

use std::collections::{BTreeMap, BTreeSet};

use super::imports::{Crate, ModulePath, Reference};

/// Edges among the modules of one folder, with the first locations of each.
type Graph = BTreeMap<String, BTreeMap<String, Vec<String>>>;

/// Returns one line for each edge in a circle: `folder: a -> b (file:line)`.
pub fn circles(module: &Crate) -> Vec<String> {
    let mut found = Vec::new();
    for (folder, graph) in graphs(module) {
        for circle in components(&graph) {
            if !folder.is_empty() && !circle.iter().any(|name| is_folder(module, &folder, name)) {
                continue;
            }
            let name = if folder.is_empty() {
                "crate".to_string()
            } else {
                format!("crate::{}", folder.join("::"))
            };
            found.push(format!(
                "{name}: circle of {}",
                circle.iter().cloned().collect::<Vec<_>>().join(", ")
            ));
            for from in &circle {
                let edges = graph[from].iter().filter(|(to, _)| circle.contains(*to));
                found.extend(edges.map(|(to, places)| {
                    let more = if places.len() > 3 {
                        format!(" and {} more", places.len() - 3)
                    } else {
                        String::new()
                    };
                    format!("  {from} -> {to} ({}{more})", places[..places.len().min(3)].join(", "))
                }));
            }
        }
    }
    found
}

fn is_folder(module: &Crate, parent: &[String], name: &str) -> bool {
    let path: ModulePath = parent.iter().cloned().chain([name.to_string()]).collect();
    !module.children[&path].is_empty()
}

fn graphs(module: &Crate) -> BTreeMap<ModulePath, Graph> {
    let imported = imported_by_parents(module);
    let mut graphs: BTreeMap<ModulePath, Graph> = BTreeMap::new();
    for reference in &module.references {
        let target = resolve(module, &imported, reference);
        let shared = reference.from.iter().zip(&target).take_while(|(a, b)| a == b).count();
        let (Some(from), Some(to)) = (reference.from.get(shared), target.get(shared)) else {
            continue;
        };
        let folder = &target[..shared];
        if module
            .children
            .get(folder)
            .is_some_and(|children| children.contains(to))
        {
            let places = graphs
                .entry(folder.to_vec())
                .or_default()
                .entry(from.clone())
                .or_default();
            let places = places.entry(to.clone()).or_default();
            let place = format!("{}:{}", reference.file, reference.line);
            if !places.contains(&place) {
                places.push(place);
            }
        }
    }
    for graph in graphs.values_mut() {
        let targets: BTreeSet<String> = graph.values().flat_map(|edges| edges.keys().cloned()).collect();
        for target in targets {
            graph.entry(target).or_default();
        }
    }
    graphs
}

type Imported = BTreeMap<(ModulePath, String), ModulePath>;

/// Origin of each name that a module with children imports.
fn imported_by_parents(module: &Crate) -> Imported {
    let parents = module
        .references
        .iter()
        .filter(|reference| !module.children[&reference.from].is_empty());
    let bound = parents.filter_map(|reference| {
        let name = reference.binds.clone()?;
        Some(((reference.from.clone(), name), reference.to.clone()))
    });
    bound.collect()
}

/// Resolves a path through the imports of the modules on it.
fn resolve(module: &Crate, imported: &Imported, reference: &Reference) -> ModulePath {
    let mut target = reference.to.clone();
    for _ in 0..8 {
        let modules = (0..=target.len())
            .rev()
            .find(|&length| module.children.contains_key(&target[..length]))
            .unwrap_or(0);
        let Some(item) = target.get(modules) else { break };
        let parent = target[..modules].to_vec();
        if parent == reference.from {
            break;
        }
        let Some(source) = imported.get(&(parent, item.clone())) else {
            break;
        };
        let rest = target[modules + 1..].to_vec();
        let next: ModulePath = source.iter().cloned().chain(rest).collect();
        if next == target {
            break;
        }
        target = next;
    }
    target
}

/// Returns strongly connected components of more than one node.
fn components(graph: &Graph) -> Vec<BTreeSet<String>> {
    let reached: BTreeMap<&String, BTreeSet<&String>> = graph.keys().map(|node| (node, reach(graph, node))).collect();
    let mut found: Vec<BTreeSet<String>> = Vec::new();
    for (node, ahead) in &reached {
        if found.iter().any(|circle| circle.contains(*node)) {
            continue;
        }
        let mut circle: BTreeSet<String> = ahead
            .iter()
            .filter(|other| reached[**other].contains(*node))
            .map(|other| other.to_string())
            .collect();
        circle.insert(node.to_string());
        if circle.len() > 1 {
            found.push(circle);
        }
    }
    found
}

fn reach<'a>(graph: &'a Graph, start: &'a String) -> BTreeSet<&'a String> {
    let mut seen = BTreeSet::new();
    let mut open = vec![start];
    while let Some(node) = open.pop() {
        open.extend(graph[node].keys().filter(|next| seen.insert(*next)));
    }
    seen
}

#[cfg(test)]
mod tests {
    use super::super::imports::read_crate;
    use super::circles;

    fn of(files: &[(&str, &str)]) -> Vec<String> {
        let read = |path: &str| {
            files
                .iter()
                .find(|(name, _)| *name == path)
                .map(|(_, text)| text.to_string())
        };
        circles(&read_crate("src/lib.rs", &read))
    }

    #[test]
    fn a_circle_between_folders_is_found_with_its_places() {
        let found = of(&[
            ("src/lib.rs", "mod a; mod b; mod c;"),
            ("src/a.rs", "pub mod deep;"),
            ("src/a/deep.rs", "\nuse crate::{c, b::{self, Thing}};"),
            ("src/b/mod.rs", "fn f() { assert!(x, crate::c::g::<u8>()); }"),
            ("src/c.rs", "#[error(\"{}\", super::a::deep::h())] struct Lost;"),
        ]);
        assert_eq!(
            found,
            [
                "crate: circle of a, b, c",
                "  a -> b (src/a/deep.rs:2)",
                "  a -> c (src/a/deep.rs:2)",
                "  b -> c (src/b/mod.rs:1)",
                "  c -> a (src/c.rs:1)",
            ]
        );
    }

    #[test]
    fn a_circle_of_sub_folders_is_found_through_what_the_parent_imports() {
        let found = of(&[
            ("src/lib.rs", "mod a;"),
            ("src/a/mod.rs", "mod x; mod y; pub use x::One; pub use self::y::Two;"),
            ("src/a/x/mod.rs", "mod inner;"),
            ("src/a/x/inner.rs", "use super::super::Two;"),
            ("src/a/y.rs", "use crate::a::One;"),
        ]);
        assert_eq!(
            found,
            [
                "crate::a: circle of x, y",
                "  x -> y (src/a/x/inner.rs:1)",
                "  y -> x (src/a/y.rs:1)"
            ]
        );
    }

    #[test]
    fn files_of_one_folder_may_know_each_other() {
        let files = [
            ("src/lib.rs", "mod a;"),
            ("src/a.rs", "mod x; mod y;"),
            ("src/a/x.rs", "use super::y;"),
            ("src/a/y.rs", "use super::x;"),
        ];
        assert_eq!(of(&files), Vec::<String>::new());
    }

    #[test]
    fn parents_children_and_tests_make_no_circle() {
        let found = of(&[
            ("src/lib.rs", "pub mod a; pub mod b; pub use a::One; use b::Two;"),
            (
                "src/a/mod.rs",
                "mod x; mod y; pub use x::One; pub struct Own; fn f() { x::g(); self::y::h(); }",
            ),
            (
                "src/a/x.rs",
                "use super::Own; use crate::a::y::Thing; pub(in crate::b) struct One;",
            ),
            (
                "src/a/y.rs",
                "use super::super::a; #[cfg(test)] mod tests { use crate::a::x::One; }",
            ),
            (
                "src/b.rs",
                "use crate::One; #[cfg(test)] use crate::a; mod inner { use super::Two; }",
            ),
        ]);
        assert_eq!(found, Vec::<String>::new());
    }
}
