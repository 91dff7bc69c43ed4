//! What can go wrong between a request and its answer, and how it is told: the client reads a kind and
//! a message, the operator's log has the detail.

use std::net::SocketAddr;

use axum::Json;
use axum::extract::rejection::{JsonRejection, PathRejection, QueryRejection};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;

use super::files::FILE_LIMIT_BYTES;
use super::guard::MIN_TOKEN_LENGTH;
use super::routes::BODY_LIMIT_BYTES;

/// Why a rig would not do what it was asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RefusalKind {
    /// It is doing something else, or is not in the state for this.
    Busy,
    /// What was asked makes no sense.
    Invalid,
    /// There is no such session, frame or product.
    NotFound,
    /// The disk is full or cannot be written.
    Disk,
    /// It tried and failed.
    Failed,
}

/// A rig's refusal: what the user is told, and what only the operator's log says.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{message}")]
pub struct Refusal {
    /// Why.
    pub kind: RefusalKind,
    /// For the user: value, unit, limit and remedy.
    pub message: String,
    /// For the operator: paths, causes, addresses. Never sent to a client.
    pub detail: Option<String>,
}

impl Refusal {
    /// A refusal whose message tells all.
    pub fn new(kind: RefusalKind, message: impl Into<String>) -> Self {
        Self { kind, message: message.into(), detail: None }
    }

    /// The same refusal with what the operator should know beside it.
    #[must_use]
    pub fn with_detail(self, detail: impl std::fmt::Display) -> Self {
        Self { detail: Some(detail.to_string()), ..self }
    }
}

/// What can go wrong in the server.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// Listening where others can connect, with nothing to keep them out.
    #[error(
        "listening on {address} would let anybody on the network turn the stage; set serve.token in the \
         configuration, a token of at least {MIN_TOKEN_LENGTH} characters such as `openssl rand -hex 16` \
         gives, or listen on 127.0.0.1"
    )]
    OpenToAll {
        /// The address.
        address: SocketAddr,
    },
    /// A token that can be guessed or does not fit in an address.
    #[error(
        "the token has {length} characters, of which {unfit} may not be in one; at least \
         {MIN_TOKEN_LENGTH} are needed, letters, digits and `-._~`: take the output of `openssl rand -hex 16`"
    )]
    WeakToken {
        /// Its characters.
        length: usize,
        /// Characters that may not be in a token.
        unfit: usize,
    },
    /// The rig would not.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// The request does not show the token.
    #[error("this daemon asks for a token; open the page as `/?token=…` or send `Authorization: Bearer …`")]
    Unauthorised,
    /// Too many wrong tokens came from where this request comes from.
    #[error(
        "too many wrong tokens came from this address; try again in {seconds} s, with the token that the daemon was given"
    )]
    TooManyGuesses {
        /// When to try again.
        seconds: u64,
    },
    /// The `Host` header names a machine that this daemon does not answer for.
    #[error(
        "this daemon does not answer for host `{host}`; open it by its address, or allow that name in the \
         daemon's configuration"
    )]
    ForeignHost {
        /// The name, shortened.
        host: String,
    },
    /// A page of another site sent the request.
    #[error("a page from `{origin}` may not use this daemon; open the daemon's own page")]
    ForeignOrigin {
        /// The page's origin, shortened.
        origin: String,
    },
    /// A state-changing request whose body is not JSON.
    #[error("the body must have the content type `application/json`, or be left out")]
    NotJson,
    /// A body that is too big.
    #[error("the body is larger than {BODY_LIMIT_BYTES} bytes; a run's settings are a few hundred")]
    TooLarge,
    /// A file that is too big.
    #[error(
        "the file is larger than {FILE_LIMIT_BYTES} bytes; put it into the data folder by other means, or take the command line"
    )]
    FileTooLarge,
    /// A body, path or query that cannot be read.
    #[error("{message}")]
    Malformed {
        /// What is wrong with it.
        message: String,
    },
    /// A name that no session or file can have.
    #[error(
        "`{name}` cannot be the name of a {what}: 1 to {limit} characters, none of them `/`, `\\` or control \
         characters, not beginning with a dot"
    )]
    BadName {
        /// Of what.
        what: &'static str,
        /// The name, shortened.
        name: String,
        /// Most bytes it may have.
        limit: usize,
    },
    /// No such route.
    #[error("there is nothing at this address; the routes are listed in /api/v1/openapi.json")]
    NoRoute,
    /// The route exists, but not for this method.
    #[error("this address does not take that method; the routes are listed in /api/v1/openapi.json")]
    WrongMethod,
    /// A bug of ours.
    #[error("the daemon failed to answer, which is a fault of the program; its log says more")]
    Panicked {
        /// The panic's message, for the log.
        detail: String,
    },
}

/// An error as a client reads it.
#[derive(Debug, Serialize, ToSchema)]
pub struct ErrorBody {
    /// The error.
    pub error: ErrorText,
}

/// The error's kind and text.
#[derive(Debug, Serialize, ToSchema)]
pub struct ErrorText {
    /// `invalid`, `unauthorised`, `slow_down`, `forbidden`, `not_found`, `method`, `busy`, `too_large`, `not_json`,
    /// `foreign_host`, `disk` or `failed`.
    pub kind: &'static str,
    /// What is wrong, with value, limit and remedy.
    pub message: String,
}

impl ServerError {
    fn told_as(&self) -> (StatusCode, &'static str) {
        match self {
            Self::Malformed { .. } | Self::BadName { .. } => (StatusCode::BAD_REQUEST, "invalid"),
            Self::Unauthorised => (StatusCode::UNAUTHORIZED, "unauthorised"),
            Self::TooManyGuesses { .. } => (StatusCode::TOO_MANY_REQUESTS, "slow_down"),
            Self::ForeignOrigin { .. } => (StatusCode::FORBIDDEN, "forbidden"),
            Self::NoRoute => (StatusCode::NOT_FOUND, "not_found"),
            Self::WrongMethod => (StatusCode::METHOD_NOT_ALLOWED, "method"),
            Self::TooLarge | Self::FileTooLarge => (StatusCode::PAYLOAD_TOO_LARGE, "too_large"),
            Self::NotJson => (StatusCode::UNSUPPORTED_MEDIA_TYPE, "not_json"),
            Self::ForeignHost { .. } => (StatusCode::MISDIRECTED_REQUEST, "foreign_host"),
            Self::Refused(refusal) => match refusal.kind {
                RefusalKind::Busy => (StatusCode::CONFLICT, "busy"),
                RefusalKind::Invalid => (StatusCode::BAD_REQUEST, "invalid"),
                RefusalKind::NotFound => (StatusCode::NOT_FOUND, "not_found"),
                RefusalKind::Disk => (StatusCode::INSUFFICIENT_STORAGE, "disk"),
                RefusalKind::Failed => (StatusCode::INTERNAL_SERVER_ERROR, "failed"),
            },
            Self::Panicked { .. } | Self::OpenToAll { .. } | Self::WeakToken { .. } => {
                (StatusCode::INTERNAL_SERVER_ERROR, "failed")
            }
        }
    }

    fn detail(&self) -> Option<&str> {
        match self {
            Self::Refused(refusal) => refusal.detail.as_deref(),
            Self::Panicked { detail } => Some(detail),
            _ => None,
        }
    }
}

impl IntoResponse for ServerError {
    fn into_response(self) -> Response {
        let (status, kind) = self.told_as();
        let message = self.to_string();
        if status.is_server_error() {
            tracing::error!(kind, %message, detail = self.detail(), "request failed");
        } else {
            tracing::info!(kind, %message, detail = self.detail(), "request refused");
        }
        let wait = match &self {
            Self::TooManyGuesses { seconds } => Some(*seconds),
            _ => None,
        };
        let mut response = (status, Json(ErrorBody { error: ErrorText { kind, message } })).into_response();
        if status == StatusCode::UNAUTHORIZED {
            response.headers_mut().insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
        }
        if let Some(seconds) = wait {
            response.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from(seconds));
        }
        response
    }
}

impl From<JsonRejection> for ServerError {
    fn from(rejection: JsonRejection) -> Self {
        match rejection.status() {
            StatusCode::PAYLOAD_TOO_LARGE => Self::TooLarge,
            StatusCode::UNSUPPORTED_MEDIA_TYPE => Self::NotJson,
            _ => Self::Malformed { message: rejection.body_text() },
        }
    }
}

impl From<PathRejection> for ServerError {
    fn from(rejection: PathRejection) -> Self {
        Self::Malformed { message: rejection.body_text() }
    }
}

impl From<QueryRejection> for ServerError {
    fn from(rejection: QueryRejection) -> Self {
        Self::Malformed { message: rejection.body_text() }
    }
}
