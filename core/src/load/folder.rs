//! What a file may refer to: regular files in its own folder and below, and nothing else.

use super::error::{Fault, LoadError, one_line};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// The folder of a file, to which everything that the file refers to is confined: no `..`, no absolute path, no URL,
/// no symbolic link that leads out, no device or pipe.
#[derive(Clone, Debug)]
pub(crate) struct Folder {
    root: Option<PathBuf>,
    file_bytes: u64,
}

impl Folder {
    /// Takes the folder of a file.
    pub(crate) fn of(file: &Path, file_bytes: u64) -> Self {
        let parent = match file.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        Self { root: parent.canonicalize().ok(), file_bytes }
    }

    /// Finds a file by its reference. Backslashes separate as slashes do: many exporters run on Windows.
    pub(crate) fn find(&self, reference: &str) -> Result<PathBuf, Fault> {
        let shown = one_line(reference);
        let outside = |why: &str| {
            Fault::unreadable(
                format!("refers to `{shown}`, {why}"),
                "put the file into the folder of the file that refers to it",
            )
        };
        if reference.contains('\0') {
            return Err(outside("which has a zero byte in it"));
        }
        let slashed = reference.replace('\\', "/");
        if slashed.trim().is_empty() {
            return Err(outside("which is no file name"));
        }
        let has_scheme = slashed.split_once(':').is_some_and(|(scheme, _)| !scheme.contains('/'));
        if has_scheme {
            return Err(outside("which is an address, not a file in its folder"));
        }
        if slashed.starts_with('/') || Path::new(&slashed).is_absolute() {
            return Err(outside("an absolute path"));
        }
        if slashed.split('/').any(|part| part == "..") {
            return Err(outside("which leads out of its folder"));
        }
        let root = self.root.as_ref().ok_or_else(|| outside("but its folder is gone"))?;
        let missing =
            |_| Fault::unreadable(format!("refers to `{shown}`, which is not there"), "add the file");
        let found = root.join(&slashed).canonicalize().map_err(missing)?;
        if !found.starts_with(root) {
            return Err(outside("a link that leads out of its folder"));
        }
        Ok(found)
    }

    /// Reads a file by its reference.
    pub(crate) fn read(&self, reference: &str) -> Result<Vec<u8>, Fault> {
        let path = self.find(reference)?;
        read_regular(&path, self.file_bytes).map_err(|fault| fault.at(format!("`{}`", one_line(reference))))
    }
}

/// Reads the file that the caller named.
pub(crate) fn read_file(path: &Path, file_bytes: u64) -> Result<Vec<u8>, LoadError> {
    read_regular(path, file_bytes).map_err(|fault| fault.in_file(path))
}

fn read_regular(path: &Path, file_bytes: u64) -> Result<Vec<u8>, Fault> {
    let io = |error: std::io::Error| {
        Fault::unreadable(format!("cannot be read ({error})"), "check the name and the permissions")
    };
    // The kind is asked before opening: opening a pipe would wait for ever.
    let metadata = std::fs::metadata(path).map_err(io)?;
    if !metadata.is_file() {
        return Err(Fault::unreadable("is not a regular file", "name a file"));
    }
    let too_large =
        |size: u64| Fault::over(format!("has {size} bytes, at most {file_bytes} are read"), "file_bytes");
    if metadata.len() > file_bytes {
        return Err(too_large(metadata.len()));
    }
    let mut bytes = Vec::with_capacity(metadata.len() as usize + 1);
    let read = File::open(path).and_then(|f| f.take(file_bytes + 1).read_to_end(&mut bytes)).map_err(io)?;
    if read as u64 > file_bytes {
        return Err(too_large(read as u64));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scratch(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("polyptych-folder-{name}-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("inner")).unwrap();
        std::fs::write(folder.join("secret.txt"), "s").unwrap();
        std::fs::write(folder.join("inner/near.txt"), "n").unwrap();
        folder
    }

    #[test]
    fn references_stay_in_the_folder() {
        let root = scratch("stay");
        let folder = Folder::of(&root.join("inner/model.obj"), 1000);
        assert_eq!(folder.read("near.txt").unwrap(), b"n");
        assert_eq!(folder.read(".\\near.txt").unwrap(), b"n");
        let absolute = root.join("secret.txt");
        for out in [
            "../secret.txt",
            "..\\secret.txt",
            "a/../../secret.txt",
            "",
            "near.txt\0",
            "file:///etc/passwd",
            "http://x/y",
            "C:\\x",
            "/etc/passwd",
            absolute.to_str().unwrap(),
            ".",
            "gone.txt",
        ] {
            assert!(folder.read(out).is_err(), "{out:?} was read");
        }
        #[cfg(unix)]
        {
            let _ = std::os::unix::fs::symlink("../secret.txt", root.join("inner/link.txt"));
            assert!(folder.read("link.txt").unwrap_err().what().contains("link that leads out"));
        }
        std::fs::remove_dir_all(root).unwrap();
    }

    #[test]
    fn large_files_devices_and_folders_are_refused() {
        let root = scratch("large");
        let error = read_file(&root.join("secret.txt"), 0).unwrap_err();
        assert!(matches!(error, LoadError::OverLimit { .. }), "{error}");
        assert!(read_file(Path::new("/dev/zero"), 10).is_err());
        assert!(read_file(&root, 10).is_err());
        std::fs::remove_dir_all(root).unwrap();
    }
}
