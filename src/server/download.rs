//! Files on their way to a client: pictures whole, large products piece by piece, and nothing twice.

use std::fs::File;
use std::io;

use axum::body::{Body, Bytes};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use tokio::io::AsyncReadExt as _;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;

/// A product may be an HTML report or an SVG: it may show itself, but run nothing here.
const FILE_POLICY: &str =
    "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src 'self' data:; frame-ancestors 'none'";
/// A browser keeps the file and asks whether it is still the same: a session's name may be used again.
const CACHING: &str = "private, no-cache";
/// What is read from the disk at once.
const PIECE_BYTES: usize = 64 * 1024;
/// Pieces that wait for a slow client, whatever the file's size.
const PIECES_IN_FLIGHT: usize = 2;

/// A file for a client.
#[derive(Debug)]
pub struct Download {
    /// Its media type.
    pub content_type: &'static str,
    /// SHA-256 of its bytes, hexadecimal: a client that has them is not sent them again.
    pub sha256: String,
    /// Its bytes.
    pub content: Content,
}

/// A file's bytes.
#[derive(Debug)]
pub enum Content {
    /// In memory: for pictures.
    Bytes(Vec<u8>),
    /// On the disk: for what may be large.
    File {
        /// The file, at its beginning.
        file: File,
        /// Its length.
        bytes: u64,
    },
}

impl Download {
    /// The answer to a request with these headers.
    pub(super) fn answer(self, request: &HeaderMap) -> Response {
        let etag = format!("\"{}\"", self.sha256);
        let known = request.get_all(header::IF_NONE_MATCH).iter().filter_map(|value| value.to_str().ok());
        let mut response = if known.flat_map(|tags| tags.split(',')).any(|tag| tag.trim() == etag) {
            StatusCode::NOT_MODIFIED.into_response()
        } else {
            let bytes = self.content.bytes();
            let headers = [
                (header::CONTENT_TYPE, HeaderValue::from_static(self.content_type)),
                (header::CONTENT_LENGTH, HeaderValue::from(bytes)),
            ];
            (headers, self.content.into_body()).into_response()
        };
        let headers = response.headers_mut();
        if let Ok(etag) = etag.parse() {
            headers.insert(header::ETAG, etag);
        }
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static(CACHING));
        headers.insert(header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(FILE_POLICY));
        response
    }
}

impl Content {
    fn bytes(&self) -> u64 {
        match self {
            Self::Bytes(bytes) => bytes.len() as u64,
            Self::File { bytes, .. } => *bytes,
        }
    }

    fn into_body(self) -> Body {
        match self {
            Self::Bytes(bytes) => bytes.into(),
            Self::File { file, .. } => {
                let (sender, receiver) = mpsc::channel(PIECES_IN_FLIGHT);
                tokio::spawn(send_pieces(file.into(), sender));
                Body::from_stream(ReceiverStream::new(receiver))
            }
        }
    }
}

/// Reads no faster than the client does, and stops when it has left.
async fn send_pieces(mut file: tokio::fs::File, sender: mpsc::Sender<io::Result<Bytes>>) {
    loop {
        let mut piece = vec![0; PIECE_BYTES];
        let sent = match file.read(&mut piece).await {
            Ok(0) => return,
            Ok(count) => {
                piece.truncate(count);
                sender.send(Ok(piece.into())).await.is_ok()
            }
            Err(error) => {
                tracing::error!(%error, "a file cannot be read further");
                // It breaks the connection off: half a file must not look like a whole one.
                let _ = sender.send(Err(error)).await;
                false
            }
        };
        if !sent {
            return;
        }
    }
}
