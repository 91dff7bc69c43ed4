//! Options of material laws, as the core's table has them.

use super::CompressMaterial;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Arg, ArgMatches, Args, Command, Error, FromArgMatches, value_parser};
use grainrig_core::contact::{LAWS, Law};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Takes the name of a law.
pub(super) fn parser() -> impl TypedValueParser<Value = CompressMaterial> {
    let names = LAWS.map(|law| PossibleValue::new(law.name).help(law.what));
    PossibleValuesParser::new(names)
        .map(|name| Law::named(&name).map_or_else(Default::default, CompressMaterial))
}

/// What was given of the laws' own parameters, by name: each has an option of its name.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(transparent)]
pub struct Parameters(pub BTreeMap<String, f64>);

impl Args for Parameters {
    fn augment_args(command: Command) -> Command {
        LAWS.iter().flat_map(|law| law.parameters).fold(command, |command, p| {
            let option = Arg::new(p.quantity.name).long(p.option).value_name("X");
            let help = format!("{} [default: {}]", p.what, p.usual);
            command.arg(option.help(help).value_parser(value_parser!(f64)).allow_negative_numbers(true))
        })
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for Parameters {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, Error> {
        let given = LAWS.iter().flat_map(|law| law.parameters).map(|p| p.quantity.name);
        Ok(Self(given.filter_map(|n| Some((n.to_owned(), *matches.get_one::<f64>(n)?))).collect()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}
