//! The description of the interface is one that generators of clients can read: the rules of `OpenAPI` 3.1 that they rest on.

use crate::rig::{Server, client};
use serde_json::Value;
use std::collections::BTreeSet;

fn document() -> Value {
    let server = Server::start();
    let mut answer = client().get(server.url("/api/v1/openapi.json")).call().unwrap();
    serde_json::from_slice(&answer.body_mut().read_to_vec().unwrap()).unwrap()
}

/// Every operation with its path and method.
fn operations(document: &Value) -> impl Iterator<Item = (&String, &String, &Value)> {
    let paths = document["paths"].as_object().unwrap().iter();
    paths.flat_map(|(path, item)| {
        item.as_object().unwrap().iter().map(move |(method, operation)| (path, method, operation))
    })
}

/// Every object within a value.
fn objects<'a>(value: &'a Value, found: &mut Vec<&'a serde_json::Map<String, Value>>) {
    match value {
        Value::Object(object) => {
            found.push(object);
            object.values().for_each(|value| objects(value, found));
        }
        Value::Array(items) => items.iter().for_each(|value| objects(value, found)),
        _ => {}
    }
}

#[test]
fn the_description_keeps_the_rules_of_openapi() {
    let document = document();
    assert!(document["openapi"].as_str().unwrap().starts_with("3.1."));
    assert!(["title", "version"].iter().all(|key| document["info"][key].is_string()));
    let mut names = BTreeSet::new();
    for (path, method, operation) in operations(&document) {
        let here = format!("{method} {path}");
        let name = operation["operationId"].as_str().unwrap();
        assert!(names.insert(name), "{here}: {name} is another operation's as well");
        assert!(operation["summary"].is_string() && operation["tags"].is_array(), "{here}");
        // Each variable part of the path is described, and nothing else is said to be one.
        let parts: BTreeSet<&str> =
            path.split('/').filter_map(|part| part.strip_prefix('{')?.strip_suffix('}')).collect();
        let parameters = operation["parameters"].as_array().map_or(&[][..], Vec::as_slice);
        let mut described = BTreeSet::new();
        for parameter in parameters {
            let (name, place) = (parameter["name"].as_str().unwrap(), parameter["in"].as_str().unwrap());
            assert!(described.insert((name, place)), "{here}: {name} twice");
            assert!(["path", "query", "header", "cookie"].contains(&place), "{here}: {place}");
            assert!(parameter["schema"].is_object(), "{here}: {name} has no schema");
            assert!(place != "path" || parameter["required"] == true, "{here}: {name}");
        }
        let in_path: BTreeSet<&str> =
            described.iter().filter(|(_, p)| *p == "path").map(|(n, _)| *n).collect();
        assert_eq!(parts, in_path, "{here}");
        let responses = operation["responses"].as_object().unwrap();
        assert!(responses.keys().any(|code| code.starts_with('2')), "{here}");
        for (code, response) in responses {
            assert!(code.parse::<u16>().is_ok_and(|code| (100..600).contains(&code)), "{here}: {code}");
            assert!(response["description"].is_string(), "{here}: {code}");
        }
        assert!(responses.contains_key("401") && responses.contains_key("429"), "{here}: wrong tokens");
    }
    let mut all = Vec::new();
    objects(&document, &mut all);
    for object in all {
        if let Some(Value::String(reference)) = object.get("$ref") {
            let there = reference.strip_prefix('#').and_then(|pointer| document.pointer(pointer));
            assert!(there.is_some(), "{reference} leads nowhere");
        }
        if let (Some(Value::Array(required)), Some(Value::Object(properties))) =
            (object.get("required"), object.get("properties"))
        {
            assert!(required.iter().all(|key| properties.contains_key(key.as_str().unwrap())), "{object:?}");
        }
        if object.get("type") == Some(&Value::from("array")) {
            assert!(object.contains_key("items") || object.contains_key("prefixItems"), "{object:?}");
        }
    }
}

#[test]
fn what_is_sent_and_what_comes_back_is_typed() {
    let document = document();
    for (path, method, operation) in operations(&document) {
        let here = format!("{method} {path}");
        for (code, response) in operation["responses"].as_object().unwrap() {
            for (kind, content) in response["content"].as_object().into_iter().flatten() {
                let mut schema = &content["schema"];
                if schema["type"] == "array" {
                    schema = &schema["items"];
                }
                let typed = schema["$ref"].is_string() || path.ends_with("/openapi.json");
                assert!(typed, "{here}: {code} is {schema}");
                if !kind.ends_with("json") && kind != "text/event-stream" {
                    let pointer = schema["$ref"].as_str().unwrap().trim_start_matches('#');
                    let bytes = document.pointer(pointer).unwrap();
                    assert!(bytes["type"] == "string" && bytes["format"] == "binary", "{here}: {bytes}");
                }
            }
        }
        if let Some(body) = operation.get("requestBody") {
            // A file is its bytes.
            let Some(content) = body["content"].get("application/json") else { continue };
            let reference = content["schema"]["$ref"].as_str().unwrap();
            let schema = document.pointer(&reference[1..]).unwrap();
            let has_example = ["example", "examples"].iter().any(|key| !schema[key].is_null());
            assert!(has_example, "{here}: no example of {reference}");
        }
    }
}

#[test]
fn what_a_client_must_show_is_described() {
    let document = document();
    let schemes = document["components"]["securitySchemes"].as_object().unwrap();
    assert!(schemes.values().any(|s| s["type"] == "http" && s["scheme"] == "bearer"), "{schemes:?}");
    let asked = document["security"].as_array().unwrap();
    assert!(!asked.is_empty());
    for alternative in asked {
        for name in alternative.as_object().unwrap().keys() {
            assert!(schemes.contains_key(name), "{name} is not described");
        }
    }
}
