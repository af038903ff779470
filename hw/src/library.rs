//! Makers' drivers, loaded at run time and never closed.
//!
//! A machine without a device needs no driver. A library stays loaded until the process ends:
//! drivers fail when they are loaded a second time after they were closed.

use core::ffi::{CStr, c_char};
use std::path::{Path, PathBuf};

use libloading::os::unix::{Library, RTLD_GLOBAL, RTLD_LAZY};

/// A maker's library.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Driver {
    /// Its name for people.
    pub name: &'static str,
    /// Names under which it is installed, in the order of trial.
    pub files: &'static [&'static str],
}

/// Reason why no library could be loaded: each name that was tried, with its failure.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{driver} cannot be loaded{}", attempts(tried))]
pub struct LoadError {
    /// Name of the driver for people.
    pub driver: &'static str,
    /// Each name that was tried, with its failure.
    pub tried: Vec<(PathBuf, LoadFailure)>,
}

/// Reason why one library could not be loaded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LoadFailure {
    /// The message of the dynamic loader, unaltered.
    #[error("{0}")]
    Loader(String),
    /// The user named the file, and the program has more rights than the user.
    #[error(
        "not loaded: rt-core has more rights than its user (file capabilities), and a library of the user's would have them too"
    )]
    NotTrusted,
    /// The library lacks these functions.
    #[error("another version, or another library: it lacks {}", .0.join(", "))]
    Incomplete(Vec<&'static str>),
}

impl LoadFailure {
    /// Both remedies for an untrusted library.
    pub(crate) const CURE_OF_NOT_TRUSTED: &str = "install it where the system finds it, then sudo ldconfig; or take the rights from the program: \
                                                  sudo dpkg-reconfigure stylet-rt-core";
}

fn attempts(tried: &[(PathBuf, LoadFailure)]) -> String {
    let line = |(name, why): &(PathBuf, LoadFailure)| format!("\n  {}: {why}", name.display());
    tried.iter().map(line).collect()
}

/// Returns whether the kernel gave this program more rights than its user has, as `setcap` does
/// (`AT_SECURE`). Such a program must not load a library that the user names, or the user's own
/// code would gain these rights.
pub fn has_more_rights_than_user() -> bool {
    // SAFETY: getauxval has no preconditions.
    unsafe { libc::getauxval(libc::AT_SECURE) != 0 }
}

/// Loads the library at `path`, or the first of the driver's files that can be loaded, and never closes it. `bind`
/// looks up its functions, or lists those that it lacks.
pub fn load<T>(
    driver: &Driver,
    path: Option<&Path>,
    bind: impl Fn(&Library) -> Result<T, Vec<&'static str>>,
) -> Result<T, LoadError> {
    let names: Vec<PathBuf> = match path {
        Some(path) => vec![path.to_owned()],
        None => driver.files.iter().map(PathBuf::from).collect(),
    };
    let mut tried = Vec::new();
    for name in names {
        // A name without a slash resolves only to folders that root writes: the loader ignores
        // LD_LIBRARY_PATH as well.
        if has_more_rights_than_user() && name.components().count() > 1 {
            tried.push((name, LoadFailure::NotTrusted));
            continue;
        }
        match load_one(&name, &bind) {
            Ok(functions) => return Ok(functions),
            Err(why) => tried.push((name, why)),
        }
    }
    let driver = driver.name;
    Err(LoadError { driver, tried })
}

fn load_one<T>(name: &Path, bind: impl Fn(&Library) -> Result<T, Vec<&'static str>>) -> Result<T, LoadFailure> {
    // SAFETY: runs the constructors of a library that the operator installed for this purpose.
    let library =
        unsafe { Library::open(Some(name), RTLD_LAZY | RTLD_GLOBAL) }.map_err(|e| LoadFailure::Loader(message(&e)))?;
    let functions = bind(&library).map_err(LoadFailure::Incomplete);
    core::mem::forget(library);
    functions
}

/// Returns the message of the dynamic loader.
fn message(error: &libloading::Error) -> String {
    match error {
        libloading::Error::DlOpen { desc } => format!("{desc:?}").trim_matches('"').to_owned(),
        other => other.to_string(),
    }
}

/// Returns a driver's string; "unknown" for none.
///
/// # Safety
///
/// `pointer` is null or a string that ends with zero.
pub unsafe fn text(pointer: *const c_char) -> String {
    if pointer.is_null() {
        return "unknown".to_owned();
    }
    // SAFETY: by the contract of this function.
    unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned()
}

/// Defines `Api`, the table of a library's functions with names and signatures. A library that
/// lacks a required one is refused.
macro_rules! functions {
    (
        required { $(fn $name:ident($($argument:ty),*) $(-> $result:ty)?;)* }
        optional { $(fn $extra:ident($($given:ty),*) $(-> $returned:ty)?;)* }
    ) => {
        /// Functions of the library.
        #[derive(Clone, Copy)]
        pub struct Api {
            $(
                #[doc = concat!("`", stringify!($name), "` of the vendor's interface.")]
                pub $name: unsafe extern "system" fn($($argument),*) $(-> $result)?,
            )*
            $(
                #[doc = concat!("`", stringify!($extra), "` of the vendor's interface, where the library has it.")]
                pub $extra: Option<unsafe extern "system" fn($($given),*) $(-> $returned)?>,
            )*
        }

        /// Names of the functions that the library must have, in the order of [`Api`].
        pub const FUNCTIONS: &[&str] = &[$(stringify!($name)),*];

        /// Names and signatures of all functions, in the order of [`Api`].
        pub const SIGNATURES: &[(&str, &str)] = &[
            $((stringify!($name), stringify!(($($argument),*) $(-> $result)?)),)*
            $((stringify!($extra), stringify!(($($given),*) $(-> $returned)?)),)*
        ];

        impl Api {
            /// Loads the library at `path`, or the first of the driver's files that can be loaded, and never closes it.
            pub fn load(path: Option<&std::path::Path>) -> Result<Self, $crate::library::LoadError> {
                $crate::library::load(&DRIVER, path, Self::from_library)
            }

            /// Returns all functions, or every name that the library lacks.
            fn from_library(library: &libloading::os::unix::Library) -> Result<Self, Vec<&'static str>> {
                let missing: Vec<_> = FUNCTIONS.iter().copied().filter(|name| {
                    // SAFETY: only the presence of the symbol is checked; it is not used.
                    unsafe { library.get::<*mut core::ffi::c_void>(name.as_bytes()) }.is_err()
                }).collect();
                $(
                    // SAFETY: the type is that of the vendor's interface; the module names the versions that share it.
                    let $name = unsafe {
                        library.get::<unsafe extern "system" fn($($argument),*) $(-> $result)?>(stringify!($name).as_bytes())
                    };
                )*
                $(
                    // SAFETY: as above.
                    let $extra = unsafe {
                        library.get::<unsafe extern "system" fn($($given),*) $(-> $returned)?>(stringify!($extra).as_bytes())
                    };
                )*
                match ($($name,)*) {
                    ($(Ok($name),)*) => Ok(Self {
                        $($name: *$name,)*
                        $($extra: $extra.ok().map(|function| *function),)*
                    }),
                    _ => Err(missing),
                }
            }
        }
    };
}
pub(crate) use functions;
