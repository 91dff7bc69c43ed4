//! Checks: a figure of a view, its limit, the verdict and the remedy.

use serde::{Deserialize, Serialize};

/// How good a view is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Nothing is wrong with it.
    Good,
    /// Usable, but a person should look at it.
    Doubtful,
    /// It should be taken again.
    Bad,
}

/// On which side of its limit a figure is good.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Bound {
    /// Good at the limit and below.
    AtMost,
    /// Good at the limit and above.
    AtLeast,
}

/// One figure of a view and what it means.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// What was looked at: `focus`, `motion`, `clipping`, `border`, `contrast`; against other views
    /// `duplicate`, `focus_change`, `clipping_change`, `exposure`, `area`, `height`, `left`, `right`.
    pub name: &'static str,
    /// The figure.
    pub value: f64,
    /// Its unit.
    pub unit: &'static str,
    /// On which side of the limit it is good.
    pub bound: Bound,
    /// The limit that it breaks; where it breaks none, the one beyond which it is doubtful.
    pub limit: f64,
    /// What follows.
    pub verdict: Verdict,
    /// What is the matter and what to do about it; absent where nothing is.
    pub remedy: Option<String>,
}

impl Check {
    /// A figure that should be at most the first limit, and is bad beyond the second.
    pub(super) fn at_most(name: &'static str, value: f64, unit: &'static str, limits: [f64; 2]) -> Self {
        let verdict = match value {
            v if v > limits[1] => Verdict::Bad,
            v if v > limits[0] => Verdict::Doubtful,
            _ => Verdict::Good,
        };
        let limit = if verdict == Verdict::Bad { limits[1] } else { limits[0] };
        Self { name, value, unit, bound: Bound::AtMost, limit, verdict, remedy: None }
    }

    /// The same check with what to do where it is not good.
    pub(super) fn or(mut self, remedy: impl FnOnce() -> String) -> Self {
        self.remedy = (self.verdict != Verdict::Good).then(remedy);
        self
    }

    /// The check in a sentence: name, value, unit, limit, remedy.
    pub fn sentence(&self) -> String {
        let round = |v: f64| {
            let digits = if v.abs() >= 100.0 || v.fract() == 0.0 { 0 } else { 2 };
            format!("{v:.digits$}")
        };
        let bound = match self.bound {
            Bound::AtMost => "the limit is",
            Bound::AtLeast => "it must be at least",
        };
        let (name, unit) = (self.name.replace('_', " "), self.unit);
        let remedy = self.remedy.as_ref().map_or_else(String::new, |r| format!("; {r}"));
        format!("{name} is {} {unit}, {bound} {} {unit}{remedy}", round(self.value), round(self.limit))
    }
}

/// What was found out about a view's quality.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ViewQuality {
    /// The worst of the checks' verdicts.
    pub verdict: Verdict,
    /// Every check that could be made.
    pub checks: Vec<Check>,
}

impl ViewQuality {
    /// The quality that follows from checks.
    pub fn of(checks: Vec<Check>) -> Self {
        let verdict = checks.iter().map(|c| c.verdict).max().unwrap_or(Verdict::Good);
        Self { verdict, checks }
    }

    /// Takes in more checks.
    pub fn add(&mut self, checks: impl IntoIterator<Item = Check>) {
        for check in checks {
            self.verdict = self.verdict.max(check.verdict);
            self.checks.push(check);
        }
    }

    /// What a person should know: value, unit, limit and remedy of each check that is not good.
    pub fn warnings(&self) -> Vec<String> {
        self.checks.iter().filter(|c| c.verdict != Verdict::Good).map(Check::sentence).collect()
    }
}
