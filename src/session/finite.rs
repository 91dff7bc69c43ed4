//! No number leaves the program that is none: JSON has no NaN and no infinity, and `serde_json` writes `null` for them
//! without a word, which a reader takes for "does not apply".

use serde::ser::{self, Serialize};
use std::fmt::{self, Display};

/// Why a value is not written as JSON.
#[derive(Debug, Clone, PartialEq)]
pub enum EncodeError {
    /// A number that is none.
    NotFinite {
        /// Where it is: keys joined by dots, places in lists in brackets.
        field: String,
        /// What it is.
        value: f64,
    },
    /// Anything else.
    Other(String),
}

impl Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::NotFinite { field, value } => write!(
                f,
                "{field} is {value}, not a number that can be stated: this is a fault of grainrig, please report it with \
                 the input; what it belongs to is not written"
            ),
            Self::Other(text) => f.write_str(text),
        }
    }
}

impl std::error::Error for EncodeError {}

impl ser::Error for EncodeError {
    fn custom<T: Display>(message: T) -> Self {
        Self::Other(message.to_string())
    }
}

impl EncodeError {
    /// The same error, seen from what holds the part.
    fn within(self, part: &str) -> Self {
        match self {
            Self::NotFinite { field, value } if !part.is_empty() => {
                let dot = if field.is_empty() || field.starts_with('[') { "" } else { "." };
                Self::NotFinite { field: format!("{part}{dot}{field}"), value }
            }
            other => other,
        }
    }
}

/// Whether every number in a value is one. Costs a walk through it.
///
/// # Errors
/// [`EncodeError::NotFinite`] with the first field that is none.
pub fn check_finite<T: Serialize + ?Sized>(value: &T) -> Result<(), EncodeError> {
    value.serialize(Walk)
}

/// A value as indented JSON with a line's end.
///
/// # Errors
/// [`EncodeError`], and nothing is returned, where a number is none.
pub fn to_json<T: Serialize + ?Sized>(value: &T) -> Result<Vec<u8>, EncodeError> {
    check_finite(value)?;
    let mut text = serde_json::to_vec_pretty(value).map_err(ser::Error::custom)?;
    text.push(b'\n');
    Ok(text)
}

/// A value as a JSON value.
///
/// # Errors
/// As [`to_json`].
pub fn to_json_value<T: Serialize + ?Sized>(value: &T) -> Result<serde_json::Value, EncodeError> {
    check_finite(value)?;
    serde_json::to_value(value).map_err(ser::Error::custom)
}

/// Goes through a value and writes nothing.
struct Walk;

/// Goes through the parts of a list; `done` counts them.
struct List {
    done: usize,
    around: &'static str,
}

/// Goes through the parts of a map; the key before the value.
struct Map {
    key: String,
    around: &'static str,
}

impl List {
    fn part<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), EncodeError> {
        let place = format!("[{}]", self.done);
        self.done += 1;
        value.serialize(Walk).map_err(|e| e.within(&place).within(self.around))
    }
}

impl Map {
    fn part<T: Serialize + ?Sized>(&self, key: &str, value: &T) -> Result<(), EncodeError> {
        value.serialize(Walk).map_err(|e| e.within(key).within(self.around))
    }
}

/// What holds no number with a point.
macro_rules! sound {
    ($($name:ident($($type:ty)?)),+ $(,)?) => {
        $(fn $name(self $(, _: $type)?) -> Result<(), EncodeError> { Ok(()) })+
    };
}

impl ser::Serializer for Walk {
    type Ok = ();
    type Error = EncodeError;
    type SerializeSeq = List;
    type SerializeTuple = List;
    type SerializeTupleStruct = List;
    type SerializeTupleVariant = List;
    type SerializeMap = Map;
    type SerializeStruct = Map;
    type SerializeStructVariant = Map;

    sound!(
        serialize_bool(bool),
        serialize_i8(i8),
        serialize_i16(i16),
        serialize_i32(i32),
        serialize_i64(i64),
        serialize_u8(u8),
        serialize_u16(u16),
        serialize_u32(u32),
        serialize_u64(u64),
        serialize_char(char),
        serialize_str(&str),
        serialize_bytes(&[u8]),
        serialize_none(),
        serialize_unit(),
        serialize_unit_struct(&'static str),
    );

    fn serialize_f32(self, value: f32) -> Result<(), EncodeError> {
        self.serialize_f64(f64::from(value))
    }

    fn serialize_f64(self, value: f64) -> Result<(), EncodeError> {
        if value.is_finite() { Ok(()) } else { Err(EncodeError::NotFinite { field: String::new(), value }) }
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> Result<(), EncodeError> {
        value.serialize(self)
    }

    fn serialize_unit_variant(self, _: &'static str, _: u32, _: &'static str) -> Result<(), EncodeError> {
        Ok(())
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        value: &T,
    ) -> Result<(), EncodeError> {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        value: &T,
    ) -> Result<(), EncodeError> {
        value.serialize(self).map_err(|e| e.within(variant))
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<List, EncodeError> {
        Ok(List { done: 0, around: "" })
    }

    fn serialize_tuple(self, _: usize) -> Result<List, EncodeError> {
        Ok(List { done: 0, around: "" })
    }

    fn serialize_tuple_struct(self, _: &'static str, _: usize) -> Result<List, EncodeError> {
        Ok(List { done: 0, around: "" })
    }

    fn serialize_tuple_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<List, EncodeError> {
        Ok(List { done: 0, around: variant })
    }

    fn serialize_map(self, _: Option<usize>) -> Result<Map, EncodeError> {
        Ok(Map { key: String::new(), around: "" })
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Map, EncodeError> {
        Ok(Map { key: String::new(), around: "" })
    }

    fn serialize_struct_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<Map, EncodeError> {
        Ok(Map { key: String::new(), around: variant })
    }
}

macro_rules! list {
    ($($trait:ident $part:ident),+) => {
        $(impl ser::$trait for List {
            type Ok = ();
            type Error = EncodeError;
            fn $part<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), EncodeError> {
                self.part(value)
            }
            fn end(self) -> Result<(), EncodeError> {
                Ok(())
            }
        })+
    };
}
list!(
    SerializeSeq serialize_element,
    SerializeTuple serialize_element,
    SerializeTupleStruct serialize_field,
    SerializeTupleVariant serialize_field
);

macro_rules! fields {
    ($($trait:ident),+) => {
        $(impl ser::$trait for Map {
            type Ok = ();
            type Error = EncodeError;
            fn serialize_field<T: Serialize + ?Sized>(
                &mut self,
                key: &'static str,
                value: &T,
            ) -> Result<(), EncodeError> {
                self.part(key, value)
            }
            fn end(self) -> Result<(), EncodeError> {
                Ok(())
            }
        })+
    };
}
fields!(SerializeStruct, SerializeStructVariant);

impl ser::SerializeMap for Map {
    type Ok = ();
    type Error = EncodeError;

    fn serialize_key<T: Serialize + ?Sized>(&mut self, key: &T) -> Result<(), EncodeError> {
        let key = serde_json::to_value(key).map_err(ser::Error::custom)?;
        self.key = key.as_str().map_or_else(|| key.to_string(), str::to_owned);
        Ok(())
    }

    fn serialize_value<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), EncodeError> {
        self.part(&self.key, value)
    }

    fn end(self) -> Result<(), EncodeError> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Serialize;
    use std::collections::BTreeMap;

    #[derive(Serialize)]
    struct Inner {
        least: Option<f64>,
        interval_mm3: [f64; 2],
    }

    #[derive(Serialize)]
    #[serde(tag = "kind")]
    enum Kind {
        Tagged { inner: Inner },
    }

    #[derive(Serialize)]
    struct Outer {
        name: &'static str,
        hull: Inner,
        views: Vec<Kind>,
        by_name: BTreeMap<u32, f32>,
    }

    fn inner(value: f64) -> Inner {
        Inner { least: None, interval_mm3: [1.0, value] }
    }

    #[test]
    fn a_number_that_is_none_is_refused_by_the_name_of_its_field() {
        let make = |a: f64, b: f64, c: f32| Outer {
            name: "NaN",
            hull: inner(a),
            views: vec![Kind::Tagged { inner: inner(2.0) }, Kind::Tagged { inner: inner(b) }],
            by_name: [(7, c)].into(),
        };
        assert!(to_json(&make(1.0, f64::MAX, f32::MIN)).is_ok());
        for (value, field) in [
            (make(f64::NAN, 1.0, 1.0), "hull.interval_mm3[1] is NaN"),
            (make(1.0, f64::NEG_INFINITY, 1.0), "views[1].inner.interval_mm3[1] is -inf"),
            (make(1.0, 1.0, f32::INFINITY), "by_name.7 is inf"),
        ] {
            let text = to_json(&value).unwrap_err().to_string();
            assert!(text.starts_with(field), "{text}");
            assert_eq!(to_json_value(&value).unwrap_err().to_string(), text);
        }
        let some = Inner { least: Some(f64::NAN), interval_mm3: [0.0; 2] };
        assert!(to_json(&some).unwrap_err().to_string().starts_with("least is NaN"));
    }
}
