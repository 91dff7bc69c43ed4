//! The monitor page, held in the binary: one file to install, and no path for a request to leave.

use axum::Router;
use axum::http::header;
use axum::routing::get;

use super::routes::App;

/// Address, content type and bytes of every file of the page.
const FILES: [(&str, &str, &[u8]); 20] = [
    ("/", "text/html; charset=utf-8", include_bytes!("../../web/index.html")),
    ("/monitor.css", "text/css; charset=utf-8", include_bytes!("../../web/monitor.css")),
    ("/monitor.js", JS, include_bytes!("../../web/monitor.js")),
    ("/status.js", JS, include_bytes!("../../web/status.js")),
    ("/format.js", JS, include_bytes!("../../web/format.js")),
    ("/chart.js", JS, include_bytes!("../../web/chart.js")),
    ("/curve.js", JS, include_bytes!("../../web/curve.js")),
    ("/compress.js", JS, include_bytes!("../../web/compress.js")),
    ("/jobs.js", JS, include_bytes!("../../web/jobs.js")),
    ("/picture.js", JS, include_bytes!("../../web/picture.js")),
    ("/sessions.js", JS, include_bytes!("../../web/sessions.js")),
    ("/stream.js", JS, include_bytes!("../../web/stream.js")),
    ("/worker.js", JS, include_bytes!("../../web/worker.js")),
    ("/watch.js", JS, include_bytes!("../../web/watch.js")),
    ("/fault.js", JS, include_bytes!("../../web/fault.js")),
    ("/rejected.js", JS, include_bytes!("../../web/rejected.js")),
    ("/verdict.js", JS, include_bytes!("../../web/verdict.js")),
    ("/dom.js", JS, include_bytes!("../../web/dom.js")),
    ("/api.js", JS, include_bytes!("../../web/api.js")),
    ("/icon.svg", "image/svg+xml", include_bytes!("../../web/icon.svg")),
];
const JS: &str = "text/javascript; charset=utf-8";

pub(super) fn routes() -> Router<App> {
    FILES.into_iter().fold(Router::new(), |router, (address, content_type, bytes)| {
        router.route(address, get(async move || ([(header::CONTENT_TYPE, content_type)], bytes)))
    })
}
