//! Recent files, as the settings keep them.

use serde::{Deserialize, Serialize};

/// Number of files that are kept.
pub const MOST: usize = 10;
const LONGEST: usize = 4096;

/// Recent file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Recent {
    /// Path of the file.
    pub path: String,
    /// True if it was opened as an image, not as a scene.
    pub is_image: bool,
}

/// Puts a file first, once.
pub fn remember(list: &mut Vec<Recent>, path: String, is_image: bool) {
    let one = Recent { path, is_image };
    list.retain(|other| *other != one);
    list.insert(0, one);
    list.truncate(MOST);
}

/// Removes invalid entries, because a settings file may contain anything.
pub fn checked(mut list: Vec<Recent>) -> Vec<Recent> {
    list.retain(|one| !one.path.is_empty() && one.path.len() <= LONGEST);
    list.truncate(MOST);
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_file_stands_first_and_ten_are_kept() {
        let mut list = Vec::new();
        for n in 0..14 {
            remember(&mut list, format!("{n}.nrrd"), false);
        }
        remember(&mut list, "9.nrrd".to_owned(), false);
        assert_eq!((list.len(), list[0].path.as_str()), (MOST, "9.nrrd"));
        assert_eq!(list.iter().filter(|one| one.path == "9.nrrd").count(), 1);
        list.push(Recent {
            path: "x".repeat(LONGEST + 1),
            is_image: true,
        });
        assert_eq!(checked(list).len(), MOST);
    }
}
