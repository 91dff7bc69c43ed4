//! The description of the API, for people and for generators of clients.

use std::sync::Arc;

use axum::{Extension, Json, Router};
use jiff::Timestamp;
use serde::Serialize;
use utoipa::openapi::schema::Ref;
use utoipa::openapi::security::{ApiKey, ApiKeyValue, Http, HttpAuthScheme, SecurityScheme};
use utoipa::openapi::{Content, RefOr, ResponseBuilder};
use utoipa::{Modify, OpenApi, ToSchema};
use utoipa_axum::router::OpenApiRouter;

use super::guard::COOKIE;
use super::routes::{self, App};
use crate::acquire::QualityMode;

#[derive(OpenApi)]
#[openapi(
    info(title = "grainrig", description = "Watch and drive the rig."),
    // Only a daemon that was given a token asks for one.
    security((), ("bearer" = []), ("cookie" = []), ("query" = [])),
    components(schemas(StreamedEvent, routes::Part, QualityMode))
)]
struct Description;

/// The routes under the address of this version, and their description.
pub(super) fn described(api: OpenApiRouter<App>) -> (Router<App>, utoipa::openapi::OpenApi) {
    let all = OpenApiRouter::with_openapi(Description::openapi()).nest("/api/v1", api);
    let (router, mut document) = all.split_for_parts();
    Tokens.modify(&mut document);
    Fences.modify(&mut document);
    // What follows a slash is one name here.
    let paths = std::mem::take(&mut document.paths.paths);
    document.paths.paths = paths.into_iter().map(|(path, item)| (path.replace("{*", "{"), item)).collect();
    (router, document)
}

/// The ways of showing the token.
struct Tokens;

impl Modify for Tokens {
    fn modify(&self, document: &mut utoipa::openapi::OpenApi) {
        let components = document.components.get_or_insert_with(Default::default);
        let bearer = SecurityScheme::Http(Http::new(HttpAuthScheme::Bearer));
        components.add_security_scheme("bearer", bearer);
        let cookie = ApiKey::Cookie(ApiKeyValue::with_description(
            COOKIE,
            "Set by the page that is opened with the token",
        ));
        components.add_security_scheme("cookie", SecurityScheme::ApiKey(cookie));
        let query = ApiKey::Query(ApiKeyValue::with_description(
            "token",
            "For GET alone: pictures and event streams",
        ));
        components.add_security_scheme("query", SecurityScheme::ApiKey(query));
    }
}

/// What the guard may answer, whichever the operation.
struct Fences;

impl Modify for Fences {
    fn modify(&self, document: &mut utoipa::openapi::OpenApi) {
        let error = |what: &str| {
            let body = Content::new(Some(Ref::from_schema_name("ErrorBody")));
            ResponseBuilder::new().description(what).content("application/json", body).build()
        };
        for item in document.paths.paths.values_mut() {
            let changing = [&mut item.post, &mut item.put, &mut item.delete].map(|o| (o, true));
            for (operation, is_changing) in changing.into_iter().chain([(&mut item.get, false)]) {
                let Some(operation) = operation else { continue };
                let takes_json = matches!(&operation.request_body,
                    Some(RefOr::T(body)) if body.content.contains_key("application/json"));
                let answers = [
                    ("401", "No token, or a wrong one", true),
                    ("403", "Sent by another site's page", is_changing),
                    ("413", "The body is too large", takes_json),
                    ("415", "The body is not JSON", takes_json),
                    ("429", "Too many wrong tokens", true),
                ];
                for (code, what, _) in answers.into_iter().filter(|(_, _, applies)| *applies) {
                    operation.responses.responses.insert(code.into(), error(what).into());
                }
            }
        }
    }
}

/// What `data` holds in the event stream: these, and the fields of the kind.
#[derive(Serialize, ToSchema)]
pub(super) struct StreamedEvent {
    /// The event's number: one more than the one before it.
    seq: u64,
    /// When, in UTC.
    #[schema(value_type = String, format = DateTime)]
    time: Timestamp,
    /// The kind: `started`, `homed`, `moving`, `captured`, `rejected`, `suspended`, `paused`, `resumed`, `aborted`,
    /// `acquisition_complete`, `silhouette`, `judged`, `hull`, `working`, `products`, `failed`, `complete`, `compression` or `job`.
    event: String,
}

/// This description.
#[utoipa::path(get, path = "/openapi.json", tag = "about", responses(
    (status = 200, description = "OpenAPI description", body = Object),
))]
pub(super) async fn document(
    Extension(document): Extension<Arc<utoipa::openapi::OpenApi>>,
) -> Json<utoipa::openapi::OpenApi> {
    Json(utoipa::openapi::OpenApi::clone(&document))
}
