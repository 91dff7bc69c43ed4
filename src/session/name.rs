//! Names that may reach the disk.

use super::SessionError;

/// Most characters of a name.
const LONGEST: usize = 64;

/// Checks a session's name or a file's name inside a session: `[A-Za-z0-9][A-Za-z0-9._-]{0,63}`, no `..`.
///
/// # Errors
/// [`SessionError::Name`] with the value and the limit that it breaks.
pub fn check_name(kind: &'static str, name: &str) -> Result<(), SessionError> {
    let limit = if name.is_empty() {
        "it is empty"
    } else if name.len() > LONGEST {
        "it is longer than 64 characters"
    } else if !name.as_bytes()[0].is_ascii_alphanumeric() {
        "it does not begin with a letter or a digit"
    } else if !name.bytes().all(|b| b.is_ascii_alphanumeric() || matches!(b, b'.' | b'_' | b'-')) {
        "it has a character that is none of these"
    } else if name.contains("..") {
        "it contains '..'"
    } else {
        return Ok(());
    };
    Err(SessionError::Name { kind, value: name.chars().take(80).collect(), limit })
}

/// The first few of many names, for a message.
pub(super) fn few<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let mut names = names.into_iter();
    let mut text = names.by_ref().take(5).collect::<Vec<_>>().join(", ");
    if names.next().is_some() {
        text.push_str(", …");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::check_name;

    #[test]
    fn only_plain_names_pass() {
        for good in ["a", "Grain-07_b.2", &"x".repeat(64)] {
            check_name("session name", good).unwrap();
        }
        let long = "x".repeat(300);
        for bad in
            ["", "..", "../x", "a/b", "a\\b", "a\0b", ".hidden", "-x", "a..b", "ä", "a b", "a\n", &long]
        {
            let text = check_name("session name", bad).unwrap_err().to_string();
            assert!(text.contains("1 to 64 letters"), "{text}");
            assert!(text.len() < 400, "{text}");
        }
    }
}
