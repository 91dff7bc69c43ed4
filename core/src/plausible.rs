//! Slips of unit: a figure that no laboratory has, but would have in another unit, is refused with the one that was
//! probably meant, unless whoever gave it confirms that it is meant so.

use std::fmt;

/// How a figure comes to be too large or too small.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slip {
    /// What was given, times this, is what was meant.
    pub factor: f64,
    /// What was given instead.
    pub form: &'static str,
    /// Below this it is not that.
    pub from: f64,
}

const fn slip(factor: f64, form: &'static str) -> Slip {
    Slip { factor, form, from: 0.0 }
}

const OF_MM: &[Slip] = &[slip(1e-3, "in µm"), slip(1e3, "in m"), slip(10.0, "in cm")];
const OF_MM3: &[Slip] = &[slip(1e-9, "in µm³"), slip(1e9, "in m³")];
const OF_MPA: &[Slip] = &[slip(1e3, "in GPa"), slip(1e-3, "in kPa"), slip(1e-6, "in Pa")];
const OF_N: &[Slip] = &[slip(1e-3, "in mN"), slip(1e3, "in kN")];
// A ratio that is a little too large is no percentage.
const OF_SHARE: &[Slip] = &[Slip { factor: 1e-2, form: "in per cent", from: 2.0 }];

/// A figure that a person gives, and what it is in any laboratory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    /// The option's or key's name.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// It is above this …
    pub low: f64,
    /// … and below this.
    pub high: f64,
    /// What it is mistaken for, the likeliest first.
    pub slips: &'static [Slip],
}

const fn quantity(
    name: &'static str,
    unit: &'static str,
    [low, high]: [f64; 2],
    slips: &'static [Slip],
) -> Quantity {
    Quantity { name, unit, low, high, slips }
}

/// The longest side of a grain.
pub const GRAIN: Quantity = quantity("the body's longest side", "mm", [0.01, 100.0], OF_MM);
/// Size of a pixel at the grain: a microscope's to a hand-held camera's.
pub const MM_PER_PX: Quantity = quantity("mm_per_px", "mm", [2e-5, 0.5], OF_MM);
/// From the lens's centre to the axis.
pub const CAMERA_DISTANCE: Quantity = quantity("camera_distance_mm", "mm", [5.0, 5e3], OF_MM);
/// A ball or pin to measure a pixel's size with.
pub const DIAMETER: Quantity = quantity("diameter_mm", "mm", [0.01, 100.0], OF_MM);
/// The simulated body.
pub const GRAIN_SIZE: Quantity = quantity("grain_size_mm", "mm", [0.01, 100.0], OF_MM);
/// A sphere instead of a grain.
pub const SPHERE: Quantity = quantity("sphere_diameter_mm", "mm", [0.01, 100.0], OF_MM);
/// Edge of a voxel of the hull's grid.
pub const VOXEL: Quantity = quantity("voxel_mm", "mm", [1e-5, 5.0], OF_MM);
/// From one view to the next.
pub const VIEW_STEP: Quantity = quantity(
    "the turn from one view to the next",
    "°",
    [0.15, 180.1],
    &[slip(57.295_779_513_082_32, "in radians")],
);
/// Young's modulus: soft plastics to diamond.
pub const YOUNG: Quantity = quantity("young_mpa", "MPa", [100.0, 1.1e6], OF_MPA);
/// Poisson's ratio: common materials contract sideways.
pub const POISSON: Quantity = quantity("poisson", "", [-1e-9, 0.495], OF_SHARE);
/// Yield stress.
pub const YIELD: Quantity = quantity("yield_mpa", "MPa", [0.5, 1e5], OF_MPA);
/// Slope of the yield stress.
pub const HARDENING: Quantity = quantity("hardening_mpa", "MPa", [0.01, 1.1e6], OF_MPA);
/// Density: pumice to osmium.
pub const DENSITY: Quantity = quantity(
    "density_t_mm3",
    "t/mm³",
    [1e-10, 2.5e-8],
    &[slip(1e-12, "in kg/m³"), slip(1e-9, "in g/cm³"), slip(1e-3, "in kg/mm³"), slip(1e-6, "in g/mm³")],
);
/// Coulomb's friction.
pub const FRICTION: Quantity = quantity("friction", "", [-1e-9, 1.5], OF_SHARE);
/// Multiple of the plates' usual speed.
pub const SPEED: Quantity = quantity("speed", "times the usual speed", [0.005, 200.0], &[]);
/// The force at which the plates stop.
pub const FORCE: Quantity = quantity("to_force_n", "N", [1e-4, 5e3], OF_N);
/// The force at which a transition is read.
pub const TRANSITION: Quantity = quantity("transition_n", "N", [1e-4, 5e3], OF_N);
/// The way at which the plates stop.
pub const APPROACH: Quantity = quantity("to_approach_mm", "mm", [1e-6, 5.0], OF_MM);
/// A time step.
pub const TIME_STEP: Quantity =
    quantity("time_step_s", "s", [1e-13, 1e-4], &[slip(1e-9, "in ns"), slip(1e-6, "in µs")]);

/// A length that has to do with the body's, as a share of whose it is between limits.
pub fn share_of(name: &'static str, body_mm: f64, [low, high]: [f64; 2]) -> Quantity {
    quantity(name, "mm", [low * body_mm, high * body_mm], OF_MM)
}

/// A volume of elements, likewise.
pub fn volume_share_of(name: &'static str, body_mm: f64, [low, high]: [f64; 2]) -> Quantity {
    quantity(name, "mm³", [(low * body_mm).powi(3), (high * body_mm).powi(3)], OF_MM3)
}

/// A figure outside what any laboratory has.
#[derive(Debug, Clone, PartialEq)]
pub struct Doubt {
    // Boxed: errors hold doubts.
    quantity: Box<Quantity>,
    value: f64,
    /// What follows from it, in words.
    follows: Option<String>,
    /// What would mend it, where that is not the figure itself.
    instead: Option<String>,
}

impl Quantity {
    /// The doubt at a value outside the limits. Of what is not finite, or zero, or negative, there is no doubt: that is for
    /// the setting's own check to refuse.
    pub fn doubt(&self, value: f64) -> Option<Doubt> {
        let fits = self.low < value && value < self.high;
        let positive = value.is_finite() && value > 0.0;
        (positive && !fits).then_some(Doubt {
            quantity: Box::new(*self),
            value,
            follows: None,
            instead: None,
        })
    }

    /// The same with a name of its own.
    #[must_use]
    pub const fn named(self, name: &'static str) -> Self {
        Self { name, ..self }
    }
}

impl Doubt {
    /// With what follows from the figure: `a grain 200 px wide would be 860 mm`.
    #[must_use]
    pub fn so_that(mut self, follows: impl Into<String>) -> Self {
        self.follows = Some(follows.into());
        self
    }

    /// The figure that was probably meant.
    pub fn meant(&self) -> Option<(f64, &'static str)> {
        let q = &self.quantity;
        let fits = |s: &&Slip| self.value >= s.from && (q.low..q.high).contains(&(self.value * s.factor));
        q.slips.iter().find(fits).map(|s| (self.value * s.factor, s.form))
    }

    /// How much too large the figure is by its slip: what it should be multiplied by.
    pub fn factor(&self) -> Option<f64> {
        self.meant().map(|(meant, _)| meant / self.value)
    }

    /// With another figure that should be changed: `mm_per_px = 0.0043 instead of 4.3`.
    #[must_use]
    pub fn where_change(mut self, instead: impl Into<String>) -> Self {
        self.instead = Some(instead.into());
        self
    }

    /// What is wrong with it, without what to do.
    fn sentence(&self) -> String {
        let q = &self.quantity;
        let gap = if q.unit.is_empty() || q.unit == "°" { "" } else { " " };
        let above = if q.low > 0.0 { format!("above {} and ", figure(q.low)) } else { String::new() };
        let follows = self.follows.as_ref().map(|follows| format!(" ({follows})")).unwrap_or_default();
        format!(
            "{} is {}{gap}{}; {above}below {}{gap}{} is usual{follows}",
            q.name,
            figure(self.value),
            q.unit,
            figure(q.high),
            q.unit
        )
    }

    /// For a result: the figure was taken as it is.
    pub fn note(&self) -> String {
        format!("taken as given: {}", self.sentence())
    }
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.sentence())?;
        let q = &self.quantity;
        let gap = if q.unit.is_empty() || q.unit == "°" { "" } else { " " };
        match (&self.instead, self.meant()) {
            (Some(instead), _) => write!(f, ": did you mean {instead}?")?,
            (None, Some((meant, form))) => {
                write!(f, ": did you mean {}{gap}{} (it looks given {form})?", figure(meant), q.unit)?;
            }
            (None, None) => write!(f, ": check its unit")?,
        }
        write!(f, "; where it is meant so, say --as-given (`as_given = true` in a configuration or request)")
    }
}

impl std::error::Error for Doubt {}

/// Whether figures may be used: the first doubt where nobody has confirmed that they are meant so, else a note for each.
///
/// # Errors
/// The first [`Doubt`].
pub fn settle(doubts: Vec<Doubt>, as_given: bool) -> Result<Vec<String>, Doubt> {
    if as_given {
        return Ok(doubts.iter().map(Doubt::note).collect());
    }
    doubts.into_iter().next().map_or_else(|| Ok(Vec::new()), Err)
}

/// The first doubt whose slip is known, where nobody has confirmed that the figure is meant so: reported before a setting's own
/// limits are.
///
/// # Errors
/// That [`Doubt`].
pub fn slips(doubts: &[Doubt], as_given: bool) -> Result<(), Doubt> {
    doubts.iter().find(|d| !as_given && d.meant().is_some()).map_or(Ok(()), |d| Err(d.clone()))
}

/// A figure as people write it, four digits of it.
pub fn figure(x: f64) -> String {
    if x != 0.0 && !(1e-4..1e6).contains(&x.abs()) {
        let text = format!("{x:.3e}");
        let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
        return format!("{}e{power}", digits.trim_end_matches('0').trim_end_matches('.'));
    }
    let digits = (3 - x.abs().max(1e-9).log10().floor() as i32).clamp(0, 9) as usize;
    let text = format!("{x:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_have_four_digits_and_no_more() {
        for (x, text) in [
            (4.3, "4.3"),
            (0.0043, "0.0043"),
            (4.3e-6, "4.3e-6"),
            (100.0, "100"),
            (1.1e6, "1.1e6"),
            (0.0, "0"),
            (387_206_719.0, "3.872e8"),
            (1.0 / 3.0, "0.3333"),
            (2.65e-9, "2.65e-9"),
        ] {
            assert_eq!(figure(x), text);
        }
    }

    #[test]
    fn a_slip_is_named_with_what_was_meant() {
        let message = |q: &Quantity, x: f64| q.doubt(x).map_or_else(String::new, |d| d.to_string());
        for (q, given, meant) in [
            (MM_PER_PX, 4.3, "did you mean 0.0043 mm (it looks given in µm)?"),
            (MM_PER_PX, 4.3e-6, "did you mean 0.0043 mm (it looks given in m)?"),
            (CAMERA_DISTANCE, 0.12, "did you mean 120 mm (it looks given in m)?"),
            (CAMERA_DISTANCE, 120e3, "did you mean 120 mm (it looks given in µm)?"),
            (YOUNG, 100.0, "did you mean 100000 MPa (it looks given in GPa)?"),
            (YOUNG, 1e11, "did you mean 100000 MPa (it looks given in Pa)?"),
            (POISSON, 22.0, "did you mean 0.22 (it looks given in per cent)?"),
            (YIELD, 0.1, "did you mean 100 MPa (it looks given in GPa)?"),
            (YIELD, 1e8, "did you mean 100 MPa (it looks given in Pa)?"),
            (DENSITY, 2650.0, "did you mean 2.65e-9 t/mm³ (it looks given in kg/m³)?"),
            (DENSITY, 2.65, "did you mean 2.65e-9 t/mm³ (it looks given in g/cm³)?"),
            (DENSITY, 2.65e-6, "did you mean 2.65e-9 t/mm³ (it looks given in kg/mm³)?"),
            (FORCE, 1e4, "did you mean 10 N (it looks given in mN)?"),
            (SPHERE, 900.0, "did you mean 0.9 mm (it looks given in µm)?"),
            (SPHERE, 9e-4, "did you mean 0.9 mm (it looks given in m)?"),
            (VIEW_STEP, 0.1257, "did you mean 7.202° (it looks given in radians)?"),
            (TIME_STEP, 1e-3, "did you mean 1e-12 s (it looks given in ns)?"),
        ] {
            let text = message(&q, given);
            assert!(text.contains(meant) && text.contains("--as-given"), "{given}: {text}");
        }
    }

    #[test]
    fn what_laboratories_have_is_not_doubted_and_what_is_no_figure_is_left_to_others() {
        for (q, good) in [
            (MM_PER_PX, 0.0043),
            (MM_PER_PX, 2e-4),
            (YOUNG, 100e3),
            (YOUNG, 3e3),
            (POISSON, 0.0),
            (DENSITY, 2.65e-9),
            (FRICTION, 0.0),
            (HARDENING, 0.0),
            (GRAIN, 0.9),
            (VIEW_STEP, 180.0),
        ] {
            assert_eq!(q.doubt(good), None, "{} {good}", q.name);
        }
        // Wrong, but no slip of unit: what is wrong with it is for the material to find.
        assert_eq!(POISSON.doubt(0.5).unwrap().meant(), None);
        for none in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
            assert_eq!(YOUNG.doubt(none), None);
        }
    }

    #[test]
    fn what_is_meant_so_is_noted_instead() {
        let doubts = || vec![YOUNG.doubt(50.0).unwrap(), DENSITY.doubt(1.0).unwrap()];
        assert!(settle(doubts(), false).unwrap_err().to_string().starts_with("young_mpa is 50 MPa"));
        let notes = settle(doubts(), true).unwrap();
        assert_eq!(notes.len(), 2);
        assert_eq!(notes[0], "taken as given: young_mpa is 50 MPa; above 100 and below 1.1e6 MPa is usual");
        assert_eq!(settle(Vec::new(), false), Ok(Vec::new()));
    }
}
