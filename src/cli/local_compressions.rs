//! The compressions of this computer as the server sees them.

use super::local_rig::{LocalRig, media_type};
use crate::jobs::CompressRequest;
use crate::server::{CompressionStarted, Compressions, Content, Download, Refusal, RefusalKind};
use crate::session::sha256_of;
use serde_json::{Value, json};
use std::fs::File;
use std::io::Seek as _;

impl Compressions for LocalRig {
    fn compress(&self, id: &str, request: CompressRequest) -> Result<CompressionStarted, Refusal> {
        let name = self.compressing.start(id, &request).map_err(|e| self.job_refused(&e))?;
        Ok(CompressionStarted { session: id.to_owned(), name })
    }

    fn resume_compression(&self, id: &str, name: &str) -> Result<(), Refusal> {
        self.compressing.resume(id, name).map_err(|e| self.job_refused(&e))
    }

    fn cancel_compression(&self) -> Result<(), Refusal> {
        self.compressing.cancel().map_err(|e| self.job_refused(&e))
    }

    fn compressions(&self, id: &str) -> Result<Value, Refusal> {
        self.compressing.list(id).map(|all| json!(all)).map_err(|e| self.job_refused(&e))
    }

    fn compression(&self, id: &str, name: &str) -> Result<Value, Refusal> {
        self.compressing.details(id, name).map(|one| json!(one)).map_err(|e| self.job_refused(&e))
    }

    fn compression_file(&self, id: &str, name: &str, file: &str) -> Result<Download, Refusal> {
        let mut opened = self.compressing.open(id, name, file).map_err(|e| self.job_refused(&e))?;
        // A file is replaced whole while the compression goes on, never changed: what is open here stays as it is.
        whole(&mut opened).map(|(sha256, bytes)| Download {
            content_type: media_type(file),
            sha256,
            content: Content::File { file: opened, bytes },
        })
    }
}

/// SHA-256 and length of a file that is open at its beginning, and is so again.
pub(super) fn whole(opened: &mut File) -> Result<(String, u64), Refusal> {
    let read = sha256_of(opened).and_then(|read| opened.rewind().map(|()| read));
    read.map_err(|e| {
        Refusal::new(RefusalKind::Disk, "the file cannot be read; the daemon's log has the reason")
            .with_detail(e)
    })
}
