//! Files beside the sessions of this computer, as the server sees them.

use super::local_compressions::whole;
use super::local_rig::{LocalRig, media_type, refused};
use crate::server::{Content, Download, Files, Refusal, RefusalKind, Upload};
use crate::session::{ExchangeName, ExchangedFile, NewFile, SessionError};
use std::io::{ErrorKind, Write};

fn named(name: &str) -> Result<ExchangeName, Refusal> {
    name.parse().map_err(|e: SessionError| refused(&e))
}

/// What is told where a name leads to no file: a link is none either.
fn absent(name: &str, error: &SessionError) -> Refusal {
    match error {
        SessionError::Io { source, .. } if source.kind() != ErrorKind::NotFound => refused(error),
        _ => {
            let text = format!("there is no file of the name {name:?}; see the list of files");
            Refusal::new(RefusalKind::NotFound, text).with_detail(error)
        }
    }
}

impl Files for LocalRig {
    fn files(&self) -> Result<Vec<ExchangedFile>, Refusal> {
        self.exchange().list().map_err(|e| refused(&e))
    }

    fn file(&self, name: &str) -> Result<Download, Refusal> {
        let mut opened = self.exchange().open(&named(name)?).map_err(|e| absent(name, &e))?;
        let (sha256, bytes) = whole(&mut opened)?;
        let content = Content::File { file: opened, bytes };
        Ok(Download { content_type: media_type(name), sha256, content })
    }

    fn put_file(&self, name: &str) -> Result<Box<dyn Upload>, Refusal> {
        let file = self.exchange().create(&named(name)?).map_err(|e| refused(&e))?;
        Ok(Box::new(Incoming(file)))
    }

    fn remove_file(&self, name: &str) -> Result<(), Refusal> {
        self.exchange().remove(&named(name)?).map_err(|e| absent(name, &e))
    }
}

struct Incoming(NewFile);

impl Write for Incoming {
    fn write(&mut self, buf: &[u8]) -> std::io::Result<usize> {
        self.0.write(buf)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.0.flush()
    }
}

impl Upload for Incoming {
    fn finish(self: Box<Self>) -> Result<(), Refusal> {
        self.0.finish().map(drop).map_err(|e| refused(&e))
    }

    fn refused(&self, error: &std::io::Error) -> Refusal {
        let text = format!("the file cannot be written: {error}; {}", crate::system::remedy(error));
        Refusal::new(RefusalKind::Disk, text)
    }
}
