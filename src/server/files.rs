//! Files beside the sessions over HTTP: put there for jobs to read, fetched once jobs have made them.

use std::io::Write;

use axum::Json;
use axum::body::{Body, Bytes};
use axum::extract::rejection::PathRejection;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use tokio::sync::mpsc;
use tokio_stream::StreamExt as _;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::error::{ErrorBody, ServerError};
use super::routes::{App, on_rig};
use super::{Download, Refusal, schemas};
use crate::session::ExchangedFile;

/// Longest file that is taken, bytes: ten times the largest deck that is meshed in a minute.
pub(super) const FILE_LIMIT_BYTES: usize = 1 << 30;
/// Pieces that wait for the disk, whatever the file's size.
const PIECES_IN_FLIGHT: usize = 4;

/// What the server asks of whoever keeps the files. A name comes from the network: `NAME` or `FOLDER/NAME`, to be checked before
/// it leads anywhere. As with [`super::Rig`], methods may block for a moment.
pub trait Files: Send + Sync + 'static {
    /// The files, by name.
    ///
    /// # Errors
    /// [`super::RefusalKind::Disk`] where they can't be listed.
    fn files(&self) -> Result<Vec<ExchangedFile>, Refusal>;

    /// One of them.
    ///
    /// # Errors
    /// [`super::RefusalKind::NotFound`] where there is none of that name, [`super::RefusalKind::Invalid`] for what is no name.
    fn file(&self, name: &str) -> Result<Download, Refusal>;

    /// Begins a file, which replaces one of that name once it is finished.
    ///
    /// # Errors
    /// [`super::RefusalKind::Invalid`] for what is no name, [`super::RefusalKind::Disk`] where it can't be made.
    fn put_file(&self, name: &str) -> Result<Box<dyn Upload>, Refusal>;

    /// Removes a file.
    ///
    /// # Errors
    /// As [`Self::file`].
    fn remove_file(&self, name: &str) -> Result<(), Refusal>;
}

/// A file on its way to the disk; dropped before it is finished it leaves nothing.
pub trait Upload: Write + Send {
    /// Makes it durable under its name.
    ///
    /// # Errors
    /// [`super::RefusalKind::Disk`].
    fn finish(self: Box<Self>) -> Result<(), Refusal>;

    /// What a client is told where a piece can't be written.
    fn refused(&self, error: &std::io::Error) -> Refusal;
}

pub(super) fn routes() -> OpenApiRouter<App> {
    OpenApiRouter::new().routes(routes!(list)).routes(routes!(one, put, remove))
}

/// The files that clients have put there and jobs have made: pictures, surfaces, the laboratory's tests, meshes, scales.
#[utoipa::path(get, path = "/files", operation_id = "files", tag = "files", responses(
    (status = 200, description = "The files", body = Vec<ExchangedFile>),
))]
pub(super) async fn list(State(app): State<App>) -> Result<Json<Vec<ExchangedFile>>, ServerError> {
    on_rig(&app, Files::files).await
}

/// A file.
#[utoipa::path(get, path = "/files/{*file}", operation_id = "file", tag = "files",
    params(("file" = String, Path, description = "`NAME` or `FOLDER/NAME`")), responses(
    (status = 200, description = "The file", content_type = "application/octet-stream", body = schemas::FileBytes,
     headers(("etag" = String, description = "SHA-256 of the file"))),
    (status = 304, description = "The client has it already"),
    (status = 400, description = "Not a name", body = ErrorBody),
    (status = 404, description = "No such file", body = ErrorBody),
))]
pub(super) async fn one(
    State(app): State<App>,
    path: Result<Path<String>, PathRejection>,
    headers: HeaderMap,
) -> Result<Response, ServerError> {
    let Path(name) = path?;
    let Json(download) = on_rig(&app, move |rig| rig.file(&name)).await?;
    Ok(download.answer(&headers))
}

/// Puts a file there, for jobs to read; it appears whole or not at all, and replaces one of that name.
#[utoipa::path(put, path = "/files/{*file}", operation_id = "put_file", tag = "files",
    params(("file" = String, Path, description = "`NAME` or `FOLDER/NAME`: 1 to 64 letters, digits, `.`, `_` or `-` each")),
    request_body(content = schemas::FileBytes, content_type = "application/octet-stream"), responses(
    (status = 204, description = "It is there"),
    (status = 400, description = "Not a name, or the body broke off", body = ErrorBody),
    (status = 413, description = "The file is too large", body = ErrorBody),
    (status = 507, description = "The disk is full", body = ErrorBody),
))]
pub(super) async fn put(
    State(app): State<App>,
    path: Result<Path<String>, PathRejection>,
    body: Body,
) -> Result<StatusCode, ServerError> {
    let Path(name) = path?;
    // `None` is the end: a body that breaks off ends without it.
    let (send, mut receive) = mpsc::channel::<Option<Bytes>>(PIECES_IN_FLIGHT);
    let writing = on_rig(&app, move |rig| {
        let mut upload = rig.put_file(&name)?;
        while let Some(piece) = receive.blocking_recv() {
            let Some(piece) = piece else { return upload.finish().map(|()| true) };
            upload.write_all(&piece).map_err(|e| upload.refused(&e))?;
        }
        Ok(false)
    });
    let reading = async move {
        let mut bytes = 0;
        let mut pieces = body.into_data_stream();
        while let Some(piece) = pieces.next().await {
            let piece = piece.map_err(|e| ServerError::Malformed {
                message: format!("the file broke off after {bytes} bytes: {e}; send it again"),
            })?;
            bytes += piece.len();
            if bytes > FILE_LIMIT_BYTES {
                return Err(ServerError::FileTooLarge);
            }
            if send.send(Some(piece)).await.is_err() {
                // The writer has an error of its own to tell.
                return Ok(());
            }
        }
        let _ = send.send(None).await;
        Ok(())
    };
    let (written, read) = tokio::join!(writing, reading);
    read?;
    written.map(|_| StatusCode::NO_CONTENT)
}

/// Removes a file.
#[utoipa::path(delete, path = "/files/{*file}", operation_id = "remove_file", tag = "files",
    params(("file" = String, Path, description = "`NAME` or `FOLDER/NAME`")), responses(
    (status = 204, description = "It is gone"),
    (status = 400, description = "Not a name", body = ErrorBody),
    (status = 404, description = "No such file", body = ErrorBody),
))]
pub(super) async fn remove(
    State(app): State<App>,
    path: Result<Path<String>, PathRejection>,
) -> Result<StatusCode, ServerError> {
    let Path(name) = path?;
    on_rig(&app, move |rig| rig.remove_file(&name)).await.map(|_| StatusCode::NO_CONTENT)
}
