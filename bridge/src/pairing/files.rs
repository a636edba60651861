//! Files and folders that nobody else may read.

use super::Error;
use std::fs::{self, DirBuilder, OpenOptions};
use std::io::Write;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::Path;

/// Refuses what others than its owner may use.
pub fn check_private(path: &Path, wanted: u32) -> Result<(), Error> {
    let metadata = fs::metadata(path).map_err(|why| Error::File(path.to_owned(), why))?;
    let mode = metadata.mode() & 0o777;
    if mode & 0o077 == 0 {
        return Ok(());
    }
    Err(Error::Open { path: path.to_owned(), mode, wanted })
}

/// Makes a folder for its owner alone, and those above it.
pub fn make_private_folder(path: &Path) -> Result<(), Error> {
    DirBuilder::new()
        .recursive(true)
        .mode(0o700)
        .create(path)
        .map_err(|why| Error::File(path.to_owned(), why))?;
    check_private(path, 0o700)
}

/// Writes a file for its owner alone: the old one stays until the new one is whole.
pub fn write_private(path: &Path, text: &str) -> Result<(), Error> {
    let failed = |why| Error::File(path.to_owned(), why);
    let mut name = path.as_os_str().to_owned();
    name.push(".new");
    match fs::remove_file(&name) {
        Err(why) if why.kind() != std::io::ErrorKind::NotFound => return Err(failed(why)),
        _ => {}
    }
    let mut file = OpenOptions::new()
        .write(true)
        .create_new(true) // never through a link that somebody left there
        .mode(0o600)
        .open(&name)
        .map_err(failed)?;
    file.write_all(text.as_bytes()).and_then(|()| file.sync_all()).map_err(failed)?;
    fs::rename(&name, path).map_err(failed)
}

/// Reads a text of moderate size.
pub fn read(path: &Path) -> Result<String, Error> {
    const MAX_BYTES: u64 = 64 << 10;
    let failed = |why| Error::File(path.to_owned(), why);
    if fs::metadata(path).map_err(failed)?.len() > MAX_BYTES {
        return Err(Error::Malformed(path.to_owned(), "too large for keys".to_owned()));
    }
    fs::read_to_string(path).map_err(failed)
}
