//! House rules that no compiler checks: walls between crates and folders, layout of tests, sizes.

mod circles;
mod crates;
mod imports;
mod layer;
mod layers;
mod shape;
mod syntax;
mod tree;

fn assert_none(found: &[String]) {
    assert!(found.is_empty(), "{} found:\n{}", found.len(), found.join("\n"));
}

/// Returns every file with one of the extensions, with its text.
fn sources(endings: &[&str]) -> Vec<(String, String)> {
    tree::files(endings)
        .into_iter()
        .map(|path| (path.clone(), tree::read(&path)))
        .collect()
}

#[test]
fn no_folders_of_a_crate_import_each_other_in_a_circle() {
    let read = |path: &str| std::fs::read_to_string(tree::root().join(path)).ok();
    let mut found = Vec::new();
    for root in tree::packages().iter().flat_map(|member| tree::crate_roots(member)) {
        let circles = circles::circles(&imports::read_crate(&root, &read));
        found.extend(circles.into_iter().map(|line| format!("{root}: {line}")));
    }
    assert_none(&found);
}

#[test]
fn no_crate_depends_on_what_its_layer_may_not_know() {
    let members = tree::packages().into_iter();
    let manifests = members.map(|folder| (folder.clone(), tree::manifest(&format!("{folder}/Cargo.toml"))));
    assert_none(&crates::forbidden(&tree::manifest("Cargo.toml"), &manifests.collect()));
}

/// A build without the relay neither downloads nor compiles any of it (ADR 18).
#[test]
fn the_workspace_takes_nothing_of_the_relay() {
    let packages = |lock: &str| {
        let lock = tree::manifest(lock);
        let listed = lock["package"].as_array().into_iter().flatten();
        let names = listed.filter_map(|package| package["name"].as_str().map(str::to_string));
        names
            .filter(|name| name.starts_with("zenoh") || name == "quinn")
            .count()
    };
    assert_eq!(packages("Cargo.lock"), 0);
    assert!(
        packages("host-ui/relay/Cargo.lock") > 0,
        "the test looks for the wrong names"
    );
}

#[test]
fn unit_tests_stand_where_the_house_puts_them() {
    let found: Vec<_> = sources(&[".rs"])
        .iter()
        .flat_map(|(path, source)| shape::test_layout(path, source))
        .collect();
    assert_none(&found);
}

#[test]
fn no_source_file_is_longer_than_the_house_allows() {
    let lines = |source: &String| source.lines().count();
    let files = sources(&[".rs"]);
    assert_none(
        &files
            .iter()
            .filter_map(|(path, source)| shape::too_long(path, lines(source), shape::LONGER))
            .collect::<Vec<_>>(),
    );
}

#[test]
fn no_public_function_returns_its_error_as_prose() {
    let members = tree::packages();
    let product = |path: &str| !path.starts_with("tests/") && !path.starts_with("benches/") && path.contains("/src/");
    let of_member = |path: &str| members.iter().any(|member| path.starts_with(&format!("{member}/src/")));
    assert_none(
        &sources(&[".rs"])
            .iter()
            .filter(|(path, _)| product(path) && of_member(path))
            .flat_map(|(path, source)| shape::prose_errors(path, source))
            .collect::<Vec<_>>(),
    );
}

#[test]
fn no_file_names_a_folder_of_one_machine() {
    let files = sources(&[
        ".rs", ".md", ".toml", ".sh", ".py", ".html", ".json", ".csv", "Makefile", ".ci/run",
    ]);
    let kept = |path: &str| !path.starts_with("tests/house/src/walls/shape.rs");
    assert_none(
        &files
            .iter()
            .filter(|(path, _)| kept(path))
            .flat_map(|(path, source)| shape::machine_paths(path, source))
            .collect::<Vec<_>>(),
    );
}
