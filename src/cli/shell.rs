//! `grainrig completions` and `grainrig man`: what a shell and `man` know of the program.

use super::output::print;
use super::{Cli, Common, about};
use anyhow::{Context as _, Result};
use clap::{Args, CommandFactory as _, ValueEnum};
use std::path::PathBuf;

/// Options of `completions`.
#[derive(Debug, Args)]
pub struct CompletionsArguments {
    /// The shell.
    #[arg(value_enum)]
    shell: Shell,
}

/// Shells that complete a command line.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Shell {
    Bash,
    Zsh,
    Fish,
}

/// Options of `man`.
#[derive(Debug, Args)]
pub struct ManArguments {
    /// Write a page for the program and one for each command into this folder, instead of the program's alone to standard
    /// output.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub(super) fn completions(arguments: &CompletionsArguments) -> Result<()> {
    let shell = match arguments.shell {
        Shell::Bash => clap_complete::Shell::Bash,
        Shell::Zsh => clap_complete::Shell::Zsh,
        Shell::Fish => clap_complete::Shell::Fish,
    };
    // What is hidden from people is offered to nobody.
    let all = Cli::command();
    let listed = all.get_subcommands().filter(|command| !command.is_hide_set()).cloned();
    let program = clap::Command::new("grainrig").version(about::SHORT.as_str());
    let mut program = program.args(all.get_arguments().cloned()).subcommands(listed);
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut program, "grainrig", &mut script);
    print(&String::from_utf8(script)?)
}

pub(super) fn man(common: &Common, arguments: &ManArguments) -> Result<()> {
    let Some(folder) = &arguments.out else {
        let mut page = Vec::new();
        clap_mangen::Man::new(Cli::command()).render(&mut page)?;
        return print(&String::from_utf8(page)?);
    };
    std::fs::create_dir_all(folder)
        .and_then(|()| clap_mangen::generate_to(Cli::command(), folder))
        .with_context(|| {
            format!("cannot write to {}; give a folder that can be written", folder.display())
        })?;
    if common.json {
        return super::output::print_json(&serde_json::json!({ "folder": folder }));
    }
    print(&format!("manual     {} (`man -l {0}/grainrig.1`)\n", folder.display()))
}
