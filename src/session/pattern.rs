//! A glob over file names, as a person or a script gives it.

use super::SessionError;
use globset::{GlobBuilder, GlobSet, GlobSetBuilder};

/// Names have at most 255 bytes; alternatives may take several of them.
const MOST_BYTES: usize = 1000;
/// Braces within braces: `*.{jpg,png}` is one. The compiler calls itself for each.
const DEEPEST: usize = 10;

/// Which file names are meant.
#[derive(Debug, Clone)]
pub(super) struct Pattern(GlobSet);

const AS_IN: &str = "write it as in `grain_*.png` or `*.{jpg,png}`";

impl Pattern {
    /// Compiles a pattern. Matching takes time in proportion to the name's length, whatever the pattern is.
    ///
    /// # Errors
    /// [`SessionError::Setting`] for one that is too long, nests too deep, or is no glob.
    pub(super) fn new(text: &str) -> Result<Self, SessionError> {
        let refuse =
            |value: String, remedy: String| Err(SessionError::Setting { setting: "pattern", value, remedy });
        if text.len() > MOST_BYTES {
            let remedy = format!("give at most {MOST_BYTES} bytes; {AS_IN}");
            return refuse(format!("{} bytes long", text.len()), remedy);
        }
        let deepest = nesting(text);
        if deepest > DEEPEST {
            let remedy = format!("nest at most {DEEPEST} of them; {AS_IN}");
            return refuse(format!("{deepest} braces deep"), remedy);
        }
        // A set tells what it cannot compile; a single glob panics at it.
        let built = GlobBuilder::new(text)
            .build()
            .and_then(|glob| GlobSetBuilder::new().add(glob).build())
            .map_err(|e| SessionError::Setting {
            setting: "pattern",
            value: e.to_string(),
            remedy: AS_IN.to_owned(),
        })?;
        Ok(Self(built))
    }

    /// Whether a file's name is meant.
    pub(super) fn matches(&self, name: &str) -> bool {
        self.0.is_match(name)
    }
}

/// The most braces that are open at once, an escaped one not counted.
fn nesting(text: &str) -> usize {
    let (mut open, mut deepest, mut escaped) = (0usize, 0, false);
    for c in text.chars() {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            '{' => {
                open += 1;
                deepest = deepest.max(open);
            }
            '}' => open = open.saturating_sub(1),
            _ => {}
        }
    }
    deepest
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn refused(text: &str) -> String {
        Pattern::new(text).unwrap_err().to_string()
    }

    #[test]
    fn what_is_no_pattern_is_refused_with_value_limit_and_remedy() {
        let nested = |n: usize| "{".repeat(n) + "a" + &"}".repeat(n);
        assert!(
            refused(&nested(250)).contains("250 braces deep; nest at most 10"),
            "{}",
            refused(&nested(250))
        );
        assert!(refused(&"{".repeat(1000)).contains("1000 braces deep"));
        assert!(refused(&"a".repeat(1001)).contains("1001 bytes long; give at most 1000"));
        for bad in ["[", "a[b", "{a", "a}", "[z-a]", "a\\"] {
            assert!(refused(bad).contains("write it as in"), "{bad}");
        }
        assert!(Pattern::new(&nested(DEEPEST)).unwrap().matches("a"));
    }

    #[test]
    fn a_pattern_means_the_names_that_it_always_meant() {
        let p = Pattern::new("*.{jpg,JPG}").unwrap();
        assert!(p.matches("v1.jpg") && p.matches("v2.JPG") && !p.matches("v1.png"));
        // Braces that are letters do not nest.
        assert!(Pattern::new(&"\\{".repeat(20)).unwrap().matches(&"{".repeat(20)));
    }

    proptest! {
        #[test]
        fn no_pattern_makes_it_panic(text in "[{}\\[\\],*?!^\\\\a-c/.-]{0,300}", name in "[abc.{}]{0,40}") {
            if let Ok(pattern) = Pattern::new(&text) {
                let _ = pattern.matches(&name);
            }
        }
        #[test]
        fn nor_does_any_text(text in any::<String>(), name in any::<String>()) {
            if let Ok(pattern) = Pattern::new(&text) {
                let _ = pattern.matches(&name);
            }
        }
        #[test]
        fn nor_one_whose_parts_multiply(n in 1usize..60, part in "(\\*\\*/|\\*|\\?|\\{a,b,\\*\\}|[a-c]|\\[!a\\])") {
            let pattern = Pattern::new(&part.repeat(n));
            if let Ok(pattern) = pattern {
                let _ = pattern.matches(&"a".repeat(255));
            }
        }
    }
}
