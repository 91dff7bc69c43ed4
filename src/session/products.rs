//! The folder of products: a set of them takes the place of the one before at once.
//!
//! ```text
//! products/        the newest set that the journal has
//! products.next/   a set that is being written; after the exchange the one before, until it is removed
//! products.old/    the one before, where the file system cannot exchange two folders, between two renames
//! ```
//!
//! The order is: all files of the new set written and synced in `products.next/`; the journal's record with every hash,
//! synced; the exchange; the old set removed. Whoever opens the session after a kill sees from the record which of the
//! two folders is the right one: before the record the new set is undone, after it the exchange is finished.

use super::SessionError;
use super::disk::{sha256_of, sync_folder, write_whole};
use super::event::{EventKind, ProductRecord};
use super::name::check_name;
use super::open::{open_inside, read_inside};
use super::recording::{PRODUCTS, Recording};
use super::writer::Session;
use rustix::fs::{CWD, RenameFlags, renameat_with};
use std::path::Path;

/// The folder of a set that is being written.
pub(super) const NEXT: &str = "products.next";
/// The folder of the set before, where two folders cannot be exchanged.
pub(super) const OLD: &str = "products.old";

impl Session {
    /// Makes a set of products durable and the session's newest, all of it at once: at every instant `products/` is
    /// either the set before or this one. Recorded products that the set does not have stay as they are. `timing_s` and
    /// `settings` are for the journal.
    ///
    /// # Errors
    /// [`SessionError`] where a name is no plain file name or the disk fails; the set before is then still the newest, or
    /// the next opening of the session puts this one in its place.
    pub fn put_products(
        &mut self,
        files: &[(String, Vec<u8>)],
        timing_s: serde_json::Value,
        settings: Option<serde_json::Value>,
    ) -> Result<Vec<ProductRecord>, SessionError> {
        let folder = self.recording().folder().to_owned();
        let records = self.stage_products(&folder.join(NEXT), files).inspect_err(|_| {
            // Where this fails the next opening removes it.
            let _ = std::fs::remove_dir_all(folder.join(NEXT));
        })?;
        self.append(EventKind::Products { files: records.clone(), timing_s, settings })?;
        put_in_place(&folder)?;
        remove(&folder.join(NEXT))?;
        Ok(records)
    }

    fn stage_products(
        &self,
        next: &Path,
        files: &[(String, Vec<u8>)],
    ) -> Result<Vec<ProductRecord>, SessionError> {
        remove(next)?;
        std::fs::create_dir(next).map_err(SessionError::io("create", next, 0))?;
        let mut records = Vec::new();
        for (name, bytes) in files {
            check_name("product file", name)?;
            let (bytes, sha256) = write_whole(next, name, bytes)?;
            records.push(ProductRecord { file: name.clone(), bytes, sha256 });
        }
        for kept in self.recording().products().filter(|p| files.iter().all(|f| f.0 != p.file)) {
            let (from, to) = (self.recording().product_path(&kept.file)?, next.join(&kept.file));
            // One that is missing stays missing; a link that is none of ours is not followed.
            if !from.symlink_metadata().is_ok_and(|m| m.is_file()) {
                continue;
            }
            // Some file systems have no second names.
            if std::fs::hard_link(&from, &to).is_err() {
                let bytes =
                    read_inside(self.recording().folder(), &format!("{PRODUCTS}/{}", kept.file), kept.bytes)?;
                write_whole(next, &kept.file, &bytes)?;
            }
        }
        sync_folder(next)?;
        Ok(records)
    }
}

impl Recording {
    /// The newest set of products, where there is one.
    pub fn newest_products(&self) -> Option<&[ProductRecord]> {
        self.events().iter().rev().find_map(|e| match &e.what {
            EventKind::Products { files, .. } => Some(&files[..]),
            _ => None,
        })
    }

    /// Names of the products that are missing, or are not the recorded bytes. Reads them all.
    pub fn changed_products(&self) -> Vec<String> {
        let folder = self.folder().join(PRODUCTS);
        self.products().filter(|p| !is_recorded(&folder, p)).map(|p| p.file.clone()).collect()
    }

    /// Whether a run was killed between writing products and putting them in their place; opening the session to write
    /// it settles that.
    pub fn is_unsettled(&self) -> bool {
        [NEXT, OLD].iter().any(|name| self.folder().join(name).exists())
    }

    /// The sub-folder that holds the newest set.
    pub(super) fn products_place(&self) -> &'static str {
        let newest = self.newest_products().unwrap_or_default();
        let holds = |place: &str| newest.iter().all(|p| is_recorded(&self.folder().join(place), p));
        if self.is_unsettled() && !holds(PRODUCTS) && holds(NEXT) { NEXT } else { PRODUCTS }
    }
}

fn is_recorded(folder: &Path, product: &ProductRecord) -> bool {
    let Ok(mut file) = open_inside(folder, &product.file) else { return false };
    let as_long = file.metadata().is_ok_and(|m| m.len() == product.bytes);
    as_long && sha256_of(&mut file).is_ok_and(|(hash, _)| hash == product.sha256)
}

/// Finishes or undoes what a killed run has left half done; the caller holds the session's lock.
pub(super) fn settle(recording: &Recording) -> Result<(), SessionError> {
    if !recording.is_unsettled() {
        return Ok(());
    }
    let folder = recording.folder();
    let [place, old] = [PRODUCTS, OLD].map(|name| folder.join(name));
    if recording.products_place() == NEXT {
        put_in_place(folder)?;
        tracing::warn!(
            "{}: the newest products, which a killed run had made, are in their place now",
            folder.display()
        );
    } else if !place.exists() && old.exists() {
        std::fs::rename(&old, &place).map_err(SessionError::io("rename", &place, 0))?;
        sync_folder(folder)?;
    }
    remove(&folder.join(NEXT))?;
    remove(&old)
}

/// The new set becomes `products/`, and what was there `products.next/`.
fn put_in_place(folder: &Path) -> Result<(), SessionError> {
    let [place, next, old] = [PRODUCTS, NEXT, OLD].map(|name| folder.join(name));
    let fail = |e| SessionError::io("put in place", &place, 0)(e);
    if renameat_with(CWD, &next, CWD, &place, RenameFlags::EXCHANGE).is_err() {
        // Not every file system can, and there may be no folder to exchange it with.
        remove(&old)?;
        match std::fs::rename(&place, &old) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(fail(e)),
            _ => {}
        }
        std::fs::rename(&next, &place).map_err(fail)?;
        sync_folder(folder)?;
        return remove(&old);
    }
    sync_folder(folder)
}

/// Removes a folder that is ours, with what is in it; fine where there is none.
fn remove(path: &Path) -> Result<(), SessionError> {
    let removed = match path.symlink_metadata() {
        Err(e) => Err(e),
        Ok(m) if m.is_dir() => std::fs::remove_dir_all(path),
        Ok(_) => std::fs::remove_file(path),
    };
    match removed {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(SessionError::io("remove", path, 0)(e)),
        _ => Ok(()),
    }
}
