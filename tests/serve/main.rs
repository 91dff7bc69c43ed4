//! The server as a browser, a script and an attacker meet it.

mod events;
mod hostile;
mod openapi;
mod rig;
#[path = "../support/sse/mod.rs"]
mod sse;

use grainrig::server::{KEPT_EVENTS, ServeOptions};
use grainrig::session::event::EventKind;
use rig::{PICTURE, SECRET, Server, client};
use serde_json::{Value, json};
use ureq::Body;
use ureq::http::Response;

fn get(server: &Server, path: &str) -> Response<Body> {
    client().get(server.url(path)).call().unwrap()
}

fn post(server: &Server, path: &str, body: &Value) -> Response<Body> {
    client().post(server.url(path)).send_json(body).unwrap()
}

fn json_of(mut response: Response<Body>) -> (u16, Value) {
    (response.status().as_u16(), response.body_mut().read_json().unwrap())
}

/// The status and the error's kind and message.
fn error_of(response: Response<Body>) -> (u16, String, String) {
    let (status, body) = json_of(response);
    let text = |field: &str| body["error"][field].as_str().unwrap().to_owned();
    (status, text("kind"), text("message"))
}

fn header(response: &Response<Body>, name: &str) -> String {
    response.headers().get(name).map(|value| value.to_str().unwrap().to_owned()).unwrap_or_default()
}

#[test]
fn a_run_is_started_paused_resumed_and_aborted() {
    let server = Server::start();
    let (status, body) = json_of(get(&server, "/api/v1/status"));
    assert_eq!((status, &body["state"]), (200, &json!("idle")));
    let started = post(&server, "/api/v1/runs", &json!({ "name": "quartz", "views": 25 }));
    assert_eq!(header(&started, "location"), "/api/v1/sessions/quartz");
    assert_eq!(json_of(started), (201, json!({ "session": "quartz" })));
    let steps = [("pause", "paused"), ("resume", "running"), ("abort", "aborted")];
    for (verb, state) in steps {
        let response =
            client().post(server.url(&format!("/api/v1/runs/current/{verb}"))).send_empty().unwrap();
        assert_eq!(response.status(), 204, "{verb}");
        assert_eq!(json_of(get(&server, "/api/v1/status")).1["state"], state);
    }
}

#[test]
fn a_refusal_has_the_status_of_its_kind_and_keeps_the_operators_detail() {
    let server = Server::start();
    let start = |body: &Value| error_of(post(&server, "/api/v1/runs", body));
    let (status, kind, message) = start(&json!({ "name": "full" }));
    assert_eq!((status, kind.as_str()), (507, "disk"));
    assert!(message.contains("500 MiB") && !message.contains(SECRET), "{message}");
    assert_eq!(start(&json!({ "name": "a", "colour": 1 })).0, 400);
    for bad in [json!({}), json!({ "name": 7 }), json!([]), json!({ "name": "" }), json!({ "name": "../x" })]
    {
        let (status, kind, _) = start(&bad);
        assert_eq!((status, kind.as_str()), (400, "invalid"), "{bad}");
    }
    assert_eq!(json_of(post(&server, "/api/v1/runs", &json!({ "name": "a" }))).0, 201);
    let (status, kind, message) = start(&json!({ "name": "b" }));
    assert_eq!((status, kind.as_str()), (409, "busy"));
    assert!(message.contains("abort it"), "{message}");
    let (status, kind, _) = error_of(get(&server, "/api/v1/sessions/none"));
    assert_eq!((status, kind.as_str()), (404, "not_found"));
}

#[test]
fn sessions_frames_and_products_are_read() {
    let server = Server::start();
    assert_eq!(json_of(get(&server, "/api/v1/sessions")), (200, json!([{ "name": "quartz" }])));
    assert_eq!(json_of(get(&server, "/api/v1/sessions/quartz")).1["name"], "quartz");
    let mut frame = get(&server, "/api/v1/sessions/quartz/frames/0000.jpg");
    assert_eq!(header(&frame, "content-type"), "image/jpeg");
    assert_eq!(frame.body_mut().read_to_vec().unwrap(), PICTURE);
    let previews = [("", b"whole"), ("?part=whole", b"whole"), ("?part=grain", b"grain")];
    for (part, shown) in previews {
        let mut preview = get(&server, &format!("/api/v1/sessions/quartz/previews/0000.jpg{part}"));
        assert_eq!(preview.body_mut().read_to_vec().unwrap(), shown, "{part}");
    }
    assert_eq!(error_of(get(&server, "/api/v1/sessions/quartz/previews/0000.jpg?part=half")).0, 400);
    assert_eq!(error_of(get(&server, "/api/v1/sessions/quartz/previews/9.jpg")).0, 404);
    // A report may be shown, but none of its scripts may run as the page.
    let report = get(&server, "/api/v1/sessions/quartz/products/report.html");
    assert!(header(&report, "content-security-policy").starts_with("sandbox; default-src 'none'"));
    let curve = get(&server, "/api/v1/sessions/quartz/compressions/elastic/files/curve.svg");
    assert!(header(&curve, "content-security-policy").starts_with("sandbox; default-src 'none'"));
    assert_eq!(header(&curve, "content-type"), "image/svg+xml");
    assert_eq!(error_of(get(&server, "/api/v1/sessions/quartz/compressions/elastic/files/lock")).0, 404);
    assert_eq!(error_of(get(&server, "/api/v1/sessions/quartz/frames/9.jpg")).0, 404);
    assert_eq!(error_of(get(&server, "/api/v1/sessions/quartz/products/9.stl")).0, 404);
}

#[test]
fn a_file_that_the_client_has_is_not_sent_again() {
    let server = Server::start();
    let url = server.url("/api/v1/sessions/quartz/frames/0000.jpg");
    let etag = header(&client().get(&url).call().unwrap(), "etag");
    let asked = |tags: &str| client().get(&url).header("if-none-match", tags).call().unwrap();
    let mut known = asked(&format!("\"other\", {etag}"));
    assert_eq!((known.status().as_u16(), header(&known, "etag")), (304, etag));
    assert!(known.body_mut().read_to_vec().unwrap().is_empty());
    // A session of the same name with another picture has another tag.
    assert_eq!(asked("\"other\"").status(), 200);
}

#[test]
fn what_is_not_there_is_told_as_json() {
    let server = Server::start();
    for path in ["/none", "/api", "/api/v1", "/api/v2/status", "/api/v1/sessions/", "/web/index.html"] {
        assert_eq!(error_of(get(&server, path)).0, 404, "{path}");
    }
    let (status, kind, _) = error_of(get(&server, "/api/v1/runs"));
    assert_eq!((status, kind.as_str()), (405, "method"));
    assert_eq!(error_of(client().delete(server.url("/api/v1/status")).call().unwrap()).0, 405);
    assert_eq!(error_of(get(&server, "/api/v1/events?after=yesterday")).0, 400);
}

#[test]
fn a_panic_is_an_answer_and_not_the_end() {
    let server = Server::start();
    let (status, kind, message) = error_of(get(&server, "/api/v1/sessions/panic"));
    assert_eq!((status, kind.as_str()), (500, "failed"));
    assert!(!message.contains(SECRET), "{message}");
    assert_eq!(get(&server, "/api/v1/status").status(), 200);
}

#[test]
fn the_page_and_its_parts_are_in_the_binary() {
    let server = Server::start();
    let mut page = get(&server, "/");
    assert_eq!(header(&page, "content-type"), "text/html; charset=utf-8");
    let policy = header(&page, "content-security-policy");
    assert!(policy.contains("default-src 'self'") && policy.contains("frame-ancestors 'none'"), "{policy}");
    assert!(!policy.contains("unsafe"), "{policy}");
    let page = page.body_mut().read_to_string().unwrap();
    // Whatever the page and its modules ask for is there.
    let mut wanted: Vec<String> = quoted(&page, "src=\"").chain(quoted(&page, "href=\"/")).collect();
    assert!(wanted.len() >= 4, "{wanted:?}");
    while let Some(path) = wanted.pop() {
        let path = format!("/{}", path.trim_start_matches(['.', '/']));
        let mut file = get(&server, &path);
        assert_eq!(file.status(), 200, "{path}");
        assert_eq!(header(&file, "x-content-type-options"), "nosniff");
        let text = file.body_mut().read_to_string().unwrap();
        assert!(!text.is_empty(), "{path}");
        wanted.extend(quoted(&text, "} from \""));
    }
}

/// What stands after `start` up to the next quotation mark.
fn quoted<'a>(text: &'a str, start: &'a str) -> impl Iterator<Item = String> + 'a {
    text.split(start).skip(1).filter_map(|rest| Some(rest.split_once('"')?.0.to_owned()))
}

#[test]
fn every_answer_says_how_it_may_be_used() {
    let server = Server::start();
    for path in ["/api/v1/status", "/api/v1/none", "/api/v1/sessions/quartz/frames/0000.jpg"] {
        let response = get(&server, path);
        let caching = if path.contains("/frames/") { "private, no-cache" } else { "no-store" };
        assert_eq!(header(&response, "cache-control"), caching, "{path}");
        assert_eq!(header(&response, "x-content-type-options"), "nosniff");
        assert_eq!(header(&response, "referrer-policy"), "no-referrer");
        assert_eq!(header(&response, "cross-origin-resource-policy"), "same-origin");
        assert!(header(&response, "content-security-policy").contains("frame-ancestors 'none'"));
        assert_eq!(header(&response, "access-control-allow-origin"), "");
    }
}

#[test]
fn the_description_has_every_route_and_no_loose_end() {
    let server = Server::start();
    let (status, document) = json_of(get(&server, "/api/v1/openapi.json"));
    assert_eq!(status, 200);
    let mut described: Vec<String> = Vec::new();
    for (path, item) in document["paths"].as_object().unwrap() {
        for method in item.as_object().unwrap().keys() {
            described.push(format!("{method} {path}"));
            let path = path
                .replace("{id}", "quartz")
                .replace("{file}", "0000.jpg")
                .replace("{name}", "elastic")
                .replace("{job}", "1");
            if method == "post" {
                assert_ne!(post(&server, &path, &json!({ "name": "a" })).status(), 405, "{path}");
            } else if !path.ends_with("/events") {
                assert_ne!(error_kind(get(&server, &path)), "no route", "{path}");
            }
        }
    }
    described.sort();
    let expected = [
        "delete /api/v1/files/{file}",
        "delete /api/v1/sessions/{id}",
        "get /api/v1/devices",
        "get /api/v1/events",
        "get /api/v1/files",
        "get /api/v1/files/{file}",
        "get /api/v1/jobs",
        "get /api/v1/jobs/{job}",
        "get /api/v1/openapi.json",
        "get /api/v1/sessions",
        "get /api/v1/sessions/{id}",
        "get /api/v1/sessions/{id}/compressions",
        "get /api/v1/sessions/{id}/compressions/{name}",
        "get /api/v1/sessions/{id}/compressions/{name}/files/{file}",
        "get /api/v1/sessions/{id}/frames/{file}",
        "get /api/v1/sessions/{id}/previews/{file}",
        "get /api/v1/sessions/{id}/products/{file}",
        "get /api/v1/sessions/{id}/rejected/{view}",
        "get /api/v1/status",
        "post /api/v1/compressions/current/cancel",
        "post /api/v1/doctor",
        "post /api/v1/jobs",
        "post /api/v1/jobs/{job}/cancel",
        "post /api/v1/runs",
        "post /api/v1/runs/current/abort",
        "post /api/v1/runs/current/pause",
        "post /api/v1/runs/current/resume",
        "post /api/v1/sessions/{id}/compressions",
        "post /api/v1/sessions/{id}/compressions/{name}/resume",
        "post /api/v1/sessions/{id}/resume",
        "put /api/v1/files/{file}",
    ];
    assert_eq!(described, expected);
    // And no route is left out of it: all are made with their description.
    let sources = [
        include_str!("../../src/server/routes.rs"),
        include_str!("../../src/server/compressing.rs"),
        include_str!("../../src/server/jobs.rs"),
        include_str!("../../src/server/files.rs"),
    ];
    assert!(sources.iter().all(|source| !source.contains(".route(")), "a route is not described");
    let text = document.to_string();
    for reference in quoted(&text, "\"$ref\":\"#") {
        assert!(document.pointer(&reference).is_some(), "{reference}");
    }
    // The status' schema has the fields that the status has.
    let sorted = |object: &Value| {
        let mut keys: Vec<String> = object.as_object().unwrap().keys().cloned().collect();
        keys.sort();
        keys
    };
    let schema = &document["components"]["schemas"]["Status"]["properties"];
    assert_eq!(sorted(schema), sorted(&json_of(get(&server, "/api/v1/status")).1));
}

fn error_kind(mut response: Response<Body>) -> String {
    let body = response.body_mut().read_to_vec().unwrap();
    let no_route = String::from_utf8_lossy(&body).contains("there is nothing at this address");
    if no_route { "no route".into() } else { String::new() }
}

#[test]
fn the_end_is_asked_for_and_streams_end_with_it() {
    let mut server = Server::start();
    let mut stream = events::open(&server, None);
    assert_eq!(stream.next().unwrap().kind, "snapshot");
    server.rig.happened(EventKind::Homed);
    assert_eq!(stream.next().unwrap().kind, "homed");
    server.stop().unwrap();
    assert!(stream.next().is_none());
    assert!(std::net::TcpStream::connect(server.address).is_err());
}

#[test]
fn without_a_token_the_network_is_refused() {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let rig = std::sync::Arc::new(rig::FakeRig { feed: grainrig::server::EventFeed::new(1, KEPT_EVENTS) });
    let served = runtime.block_on(async {
        let listener = tokio::net::TcpListener::bind("0.0.0.0:0").await.unwrap();
        grainrig::server::serve(listener, rig, ServeOptions::default(), async {}).await
    });
    let message = served.unwrap_err().to_string();
    assert!(message.contains("0.0.0.0") && message.contains("token"), "{message}");
}
