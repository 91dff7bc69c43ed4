//! The interface as a stranger's program has it: `examples/client.py`, made from the description, and the description held
//! against what the daemon really answers.

use crate::skip::{Lacking, skip};
use std::process::Command;

use crate::daemon::{Lab, SMALL, files};
use serde_json::{Value, json};

const CLIENT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/client.py");

/// Why a value is not of a schema's form, where it is not.
fn misfit(document: &Value, schema: &Value, value: &Value) -> Option<String> {
    if let Some(reference) = schema["$ref"].as_str() {
        return misfit(document, document.pointer(&reference[1..]).unwrap(), value);
    }
    for any in ["oneOf", "anyOf"] {
        if let Some(forms) = schema[any].as_array() {
            let all: Vec<_> = forms.iter().map(|form| misfit(document, form, value)).collect();
            let fits = all.iter().any(Option::is_none);
            return (!fits).then(|| format!("{value} is none of {all:?}"));
        }
    }
    if let Some(forms) = schema["allOf"].as_array() {
        return forms.iter().find_map(|form| misfit(document, form, value));
    }
    let kinds: Vec<&str> = match &schema["type"] {
        Value::String(kind) => vec![kind],
        Value::Array(kinds) => kinds.iter().filter_map(Value::as_str).collect(),
        _ => Vec::new(),
    };
    let is = |kind: &str| match kind {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "integer" => value.is_i64() || value.is_u64(),
        "number" => value.is_number(),
        "string" => value.is_string(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        _ => false,
    };
    if !kinds.is_empty() && !kinds.iter().any(|kind| is(kind)) {
        return Some(format!("{value} is no {kinds:?}"));
    }
    if let Some(known) = schema["enum"].as_array()
        && !known.contains(value)
    {
        return Some(format!("{value} is none of {known:?}"));
    }
    if let Some(items) = value.as_array() {
        return items.iter().find_map(|item| misfit(document, &schema["items"], item));
    }
    let object = value.as_object()?;
    let required = schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str);
    if let Some(missing) = required.into_iter().find(|key| !object.contains_key(*key)) {
        return Some(format!("{missing} is missing"));
    }
    let properties = schema["properties"].as_object().into_iter().flatten();
    let mut present = properties.filter_map(|(key, form)| Some((key, form, object.get(key)?)));
    present.find_map(|(key, form, value)| Some(format!("{key}: {}", misfit(document, form, value)?)))
}

#[test]
fn a_client_made_from_the_description_captures_downloads_and_compresses() {
    if Command::new("python3").arg("--version").output().is_err() {
        return skip(Lacking::System, "there is no python3");
    }
    let lab = Lab::new(SMALL);
    let daemon = lab.serve();
    let out = tempfile::tempdir().unwrap();
    let url = format!("http://{}", daemon.address);
    let mut command = Command::new("python3");
    command.arg(CLIENT).args([
        "quartz",
        "--url",
        &url,
        "--size-mm",
        "0.15",
        "--to-force-n",
        "1",
        "--size-at-contact-mm",
        "0.1",
    ]);
    let ran = command.arg("--out").arg(out.path()).output().unwrap();
    let said = String::from_utf8_lossy(&ran.stdout).into_owned() + &String::from_utf8_lossy(&ran.stderr);
    assert!(ran.status.success(), "{said}");
    assert!(said.contains("mm3") && said.contains("elastic: "), "{said}");
    for (path, bytes) in files(&lab.data().join("quartz/products")) {
        let there = out.path().join("quartz").join(path.file_name().unwrap());
        assert!(std::fs::read(&there).unwrap() == bytes, "{}", there.display());
    }
    let pressed = out.path().join("quartz/elastic/result.json");
    let result: Value = serde_json::from_slice(&std::fs::read(pressed).unwrap()).unwrap();
    assert_eq!(result["finished"], true);

    // Every answer that is described as JSON has the form that the description states.
    let (_, document) = daemon.get("/openapi.json");
    for place in [
        "/status",
        "/devices",
        "/sessions",
        "/sessions/{id}",
        "/sessions/{id}/compressions",
        "/sessions/{id}/compressions/{name}",
        "/sessions/none",
    ] {
        let (status, answer) = daemon.get(&place.replace("{id}", "quartz").replace("{name}", "elastic"));
        let described = &document["paths"][format!("/api/v1{}", place.replace("none", "{id}"))]["get"];
        let schema = &described["responses"][status.to_string()]["content"]["application/json"]["schema"];
        assert!(schema.is_object(), "{place}: {status} is not described");
        assert_eq!(misfit(&document, schema, &answer), None, "{place}");
    }
    // The doctor's and a second run's answers too: `session`, and the older word for it.
    let form = |path: &str, status: u16| {
        document["paths"][path]["post"]["responses"][status.to_string()]["content"]["application/json"]["schema"]
            .clone()
    };
    let (status, answer) = daemon.post("/doctor", None);
    assert_eq!(misfit(&document, &form("/api/v1/doctor", status), &answer), None);
    let (status, answer) = daemon.post("/runs", Some(&json!({ "name": "again", "plan": { "views": 5 } })));
    assert_eq!((status, misfit(&document, &form("/api/v1/runs", status), &answer)), (201, None));
    // Whoever has the answer sees that run, not the end of the one before.
    assert_eq!(daemon.get("/status").1["session"], "again");
    let (status, answer) = daemon.post("/runs", Some(&json!({ "session": ".hidden" })));
    assert_eq!((status, misfit(&document, &form("/api/v1/runs", status), &answer)), (400, None));
}
