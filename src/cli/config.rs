//! `grainrig config`: what is set, and what set it.

use super::output::{print, print_json};
use super::{Common, DATA_ENV};
use anyhow::{Context as _, Result};
use clap::Args;
use clap::parser::ValueSource;
use serde_json::{Map, Value, json};
use std::fmt::Write as _;

/// The defaults, each with its unit and what it is for.
const DEFAULT: &str = include_str!("../../config/simulated.toml");
/// Keys that nobody is shown.
const SECRET: [&str; 1] = ["serve.token"];

/// Options of `config`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Print the default configuration, every key with its unit and what it is for: the beginning of a file of your own.
    #[arg(long, conflicts_with = "schema")]
    default: bool,
    /// Print a JSON Schema, by which an editor completes and checks the file.
    #[arg(long)]
    schema: bool,
}

pub(super) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    if arguments.default {
        return print(DEFAULT);
    }
    if arguments.schema {
        let schema = schemars::schema_for!(crate::config::Config);
        return print(&(serde_json::to_string_pretty(&schema)? + "\n"));
    }
    let found = common.found()?;
    let mut config = found.read()?;
    let text = found.path.as_ref().map(std::fs::read_to_string).transpose()?.unwrap_or_default();
    let file: Value = serde_json::to_value(text.parse::<toml::Table>()?)?;
    config.as_given |= common.as_given;
    let mut settings = Vec::new();
    flatten(&mut Vec::new(), &serde_json::to_value(&config)?, &mut settings);
    let source = |key: &[String]| match key {
        [only] if only == "as_given" && common.as_given => "--as-given",
        key => key.iter().try_fold(&file, |at, name| at.get(name)).map_or("default", |_| "file"),
    };
    let data_source = match common.data_by {
        Some(ValueSource::CommandLine) => "--data",
        Some(ValueSource::EnvVariable) => DATA_ENV,
        _ => "default",
    };
    if common.json {
        let settings: Map<String, Value> = (settings.iter())
            .map(|(key, value)| {
                let name = key.join(".");
                let value = if is_secret(&name, value) { &json!("not shown") } else { value };
                (name, json!({ "value": value, "source": source(key) }))
            })
            .collect();
        print_json(&json!({
            "configuration": { "path": found.path, "source": found.place.name(), "absent": found.absent },
            "data": { "path": common.data, "source": data_source },
            "settings": settings,
        }))?;
    } else {
        let mut told = format!("# configuration: {found}\n");
        for path in &found.absent {
            writeln!(told, "# looked for:    {}, which is not there", path.display())?;
        }
        writeln!(told, "# data folder:   {} ({data_source})", common.data.display())?;
        let lines = settings.iter().map(|(key, value)| Ok((line(key, value)?, source(key))));
        let lines: Vec<(String, &str)> = lines.collect::<Result<_>>()?;
        let wide = lines.iter().map(|(line, _)| line.chars().count()).filter(|n| *n < 60).max().unwrap_or(0);
        for (line, source) in lines {
            writeln!(told, "{line:<wide$}  # {source}")?;
        }
        print(&told)?;
    }
    // What can't be used is shown all the same: that is where somebody looks for the reason.
    Ok(config.check()?)
}

/// Every key that can be set, by its path, with its value; null where it has none.
fn flatten(path: &mut Vec<String>, value: &Value, out: &mut Vec<(Vec<String>, Value)>) {
    match value {
        Value::Object(table) if !table.is_empty() => {
            for (key, value) in table {
                path.push(key.clone());
                flatten(path, value, out);
                path.pop();
            }
        }
        // A table in which nothing is set.
        Value::Object(_) => {}
        value => out.push((path.clone(), value.clone())),
    }
}

fn is_secret(name: &str, value: &Value) -> bool {
    SECRET.contains(&name) && !value.is_null()
}

/// A key as a line of TOML: what this prints is itself a configuration.
fn line(key: &[String], value: &Value) -> Result<String> {
    let is_bare = |k: &str| k.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c));
    let quoted =
        key.iter().map(|k| if is_bare(k) { k.clone() } else { toml::Value::from(k.as_str()).to_string() });
    let name = quoted.collect::<Vec<_>>().join(".");
    Ok(match value {
        Value::Null => format!("# {name} is not set"),
        value if is_secret(&name, value) => format!("# {name} is set and not shown"),
        value => format!("{name} = {}", toml::Value::try_from(value).context("no TOML")?),
    })
}
