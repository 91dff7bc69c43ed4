//! Consistency of a view with the views beside it: bounds that every rigid body keeps as it turns.
//!
//! The widest reach of a body's rows to one side is a support function of the stage's angle, and so is the area
//! between each row's ends. For directions a before and b behind, the support function h keeps
//!
//! ```text
//!     h(θ) sin(a + b) ≤ h(θ − a) sin b + h(θ + b) sin a
//! ```
//!
//! because the direction θ is a sum of the other two (Rockafellar, Convex Analysis, 1970, §13). It holds for a flake
//! that is seen edge-on just as for a ball, so a view that breaks it is not one of a rigid body that turns: no
//! grain is too angular for this. A telecentric lens is assumed; perspective, noise and the motor's errors are what
//! the tolerances are for.

use super::{Check, Traits};
use std::collections::BTreeSet;

/// Views further apart than this constrain each other too little, degrees: two steps of the usual 7.2°.
const FURTHEST_DEG: f64 = 15.5;
/// Views nearer than this are taken at one angle: a closing view.
const NEAREST_DEG: f64 = 0.5;
/// Below this noise (grey levels; rounding alone makes 0.29) a picture was computed rather than taken, and a body
/// of revolution looks the same twice.
const LEAST_NOISE: f64 = 0.5;
/// A view's blur over its neighbours': depth of field lets it change with the angle, but not at once.
const BLUR_FACTOR: [f64; 2] = [1.5, 2.0];
/// And this much more, pixels.
const BLUR_MORE_PX: [f64; 2] = [0.5, 1.5];
/// Change of the background's level as a share of the contrast: lamps flicker by a few per cent.
const EXPOSURE_SHARE: [f64; 2] = [0.06, 0.2];
/// And at least this many grey levels: uneven light, looked at beside a grain that moves.
const EXPOSURE_LEVELS: [f64; 2] = [5.0, 12.0];
/// Where fewer than two views are beside it, all views on the turntable are compared in light; it may then be doubtful only
/// beyond so many times as much, since the grain hides another part of an uneven background in each.
const FAR_LIGHT: f64 = 2.0;
/// Change of the share of full pixels, in points of per cent.
const FULL_POINTS: [f64; 2] = [25.0, 50.0];
/// Change of the top row as a share of the grain's height. A top that lies off the axis moves with a camera that
/// leans or looks down on it, by a tenth of its distance from the axis for 6°.
const TOP_SHARE: [f64; 2] = [0.015, 0.05];
/// And this much more, pixels.
const TOP_MORE_PX: [f64; 2] = [1.0, 2.0];
/// What the area may break its bounds by, as a share of the mean area: a hundredth is a third of a pixel all round
/// a grain of 130 px.
const AREA_SHARE: [f64; 2] = [0.02, 0.06];
/// And so many pixels more all round a disc of that area before it is bad: a view by itself may cut a small grain at another row
/// than all views together do.
const AREA_MORE_PX: [f64; 2] = [0.0, 0.6];
/// What a reach may break its bounds by, as a share of the mean width.
const REACH_SHARE: [f64; 2] = [0.01, 0.04];
/// And this much more, pixels: bearings and cameras shake by fractions of one.
const REACH_MORE_PX: [f64; 2] = [1.5, 3.0];
/// An extrapolation from two views has about twice the error of a mean of two.
const EXTRAPOLATED: f64 = 2.0;
/// Where more than this share of the views breaks its bounds, it is the angles that are wrong, not the views.
const MOST_OUTLIERS: f64 = 0.25;

/// The traits of a view and its angle on the turntable.
#[derive(Debug, Clone, Copy)]
pub struct ViewTraits<'a> {
    /// Its index, for what a person reads.
    pub index: usize,
    /// The stage's angle, degrees; `None` where the view has a camera of its own.
    pub angle_deg: Option<f64>,
    /// Its figures.
    pub traits: &'a Traits,
}

/// What each view's figures are against the others', in the order of the views. Neighbours are views at most 15.5°
/// away on a turntable; a view that has none is looked at for repeating another, and on a turntable for its focus and light
/// beside all others.
pub fn between(views: &[ViewTraits]) -> Vec<Vec<Check>> {
    let others = |k: usize| -> Vec<ViewTraits> {
        views.iter().enumerate().filter(|(j, _)| *j != k).map(|(_, v)| *v).collect()
    };
    let mut checks: Vec<Vec<Check>> = (0..views.len())
        .map(|k| {
            let mut out = vec![duplicate(&views[..k], &views[k])];
            out.extend(beside(&others(k), &views[k]));
            out
        })
        .collect();
    // A view in another light, or out of focus, shows another outline: that is no fault of those beside it.
    let spoiled: Vec<bool> =
        checks.iter().map(|checks| checks.iter().any(|c| c.verdict == super::Verdict::Bad)).collect();
    for series in Series::ALL {
        let points = series.points(views);
        let sound: Vec<Point> = points.iter().filter(|p| !spoiled[p.view]).copied().collect();
        let culprits = outliers(&sound, series.limits(views)[0]);
        let rest: Vec<Point> = sound.iter().filter(|p| !culprits.contains(&p.view)).copied().collect();
        for (k, out) in checks.iter_mut().enumerate() {
            let Some(point) = points.iter().find(|p| p.view == k) else { continue };
            out.extend(series.check(&rest, point, views, culprits.contains(&k)));
        }
    }
    checks
}

/// What a new view's figures are against those of the views before it. Only what breaks a bound for certain counts:
/// a grain may well show more than the views so far foretell.
pub fn against(earlier: &[ViewTraits], view: &ViewTraits) -> Vec<Check> {
    let mut checks = vec![duplicate(earlier, view)];
    checks.extend(beside(earlier, view));
    let all: Vec<ViewTraits> = earlier.iter().chain([view]).copied().collect();
    for series in Series::ALL {
        let points = series.points(&all);
        let (here, rest): (Vec<Point>, Vec<Point>) =
            points.into_iter().partition(|p| p.view == earlier.len());
        checks.extend(here.first().and_then(|point| series.check(&rest, point, &all, true)));
    }
    checks
}

fn duplicate(earlier: &[ViewTraits], view: &ViewTraits) -> Check {
    let same = |v: &&ViewTraits| v.traits.pixels == view.traits.pixels && view.traits.noise >= LEAST_NOISE;
    let first = earlier.iter().find(same);
    Check::at_most("duplicate", earlier.iter().filter(same).count() as f64, "earlier views", [0.0, 0.0]).or(|| {
        format!(
            "its pixels are those of view {}, noise and all: the camera has delivered an old picture, or a file was \
             copied; take it again",
            first.map_or(0, |v| v.index)
        )
    })
}

fn away(a: &ViewTraits, b: &ViewTraits) -> Option<f64> {
    a.angle_deg.zip(b.angle_deg).map(|(a, b)| a - b)
}

/// The two nearest views on either side.
fn neighbours<'a>(others: &[ViewTraits<'a>], view: &ViewTraits) -> Vec<ViewTraits<'a>> {
    let side = |sign: f64| {
        let mut found: Vec<(f64, ViewTraits)> = (others.iter())
            .filter_map(|o| away(o, view).map(|d| (sign * d, *o)))
            .filter(|(d, _)| (0.0..=FURTHEST_DEG).contains(d) && (sign > 0.0 || *d > 0.0))
            .collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.into_iter().take(2).map(|(_, o)| o).collect::<Vec<_>>()
    };
    [side(-1.0), side(1.0)].concat()
}

/// The middle value, the lower of two.
fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len().checked_sub(1)? / 2).copied()
}

/// Focus, light and height against the neighbours' medians.
fn beside(others: &[ViewTraits], view: &ViewTraits) -> Vec<Check> {
    let near = neighbours(others, view);
    let of = |views: &[ViewTraits], figure: fn(&Traits) -> f64| {
        median(views.iter().map(|n| figure(n.traits)).collect())
    };
    let here = view.traits;
    let both = |f: &dyn Fn(usize) -> f64| [f(0), f(1)];
    let mut checks = Vec::new();
    // Where the steps are long, all views on the turntable stand for the neighbours: the lens is the same.
    let far: Vec<ViewTraits> = others.iter().filter(|o| away(o, view).is_some()).copied().collect();
    let sharp = if near.is_empty() { &far } else { &near };
    if let Some(blur) = of(sharp, |t| t.blur_px) {
        let limits = both(&|k| BLUR_FACTOR[k] * blur + BLUR_MORE_PX[k]);
        checks.push(Check::at_most("focus_change", here.blur_px, "px", limits).or(|| {
            format!(
                "the views beside it have {blur:.2} px: look whether lens, table or grain moved during the exposure, \
                 and switch the autofocus off"
            )
        }));
    }
    checks.extend(lit(&near, &far, here));
    if let Some(top) = of(&near, |t| t.top).filter(|_| near.len() >= 2) {
        let tops = both(&|k| TOP_MORE_PX[k] + TOP_SHARE[k] * here.height);
        checks.push(Check::at_most("height", (here.top - top).abs(), "px", tops).or(|| {
            format!(
                "the outline's top is in row {:.1}, in neighbouring views in row {top:.1}, and turning does not lift a \
                 grain: look for something that hangs into the picture, a grain that tips, a camera that sinks",
                here.top
            )
        }));
    }
    checks
}

/// Light against the views beside it, or against all where these are fewer than two: the lamp is the same.
fn lit(near: &[ViewTraits], far: &[ViewTraits], here: &Traits) -> Vec<Check> {
    let is_near = near.len() >= 2;
    let (others, whose) = if is_near { (near, "neighbouring") } else { (far, "the other") };
    let of =
        |figure: &dyn Fn(&Traits) -> f64| median(others.iter().map(|o| figure(o.traits)).collect::<Vec<_>>());
    let (Some(contrast), Some(background), Some(full)) =
        (of(&|t| t.contrast), of(&|t| t.background), of(&|t| t.full_share))
    else {
        return Vec::new();
    };
    // What half of the others are as near as: where there are but two, and one of them is spoiled, the other one.
    let apart = if is_near {
        (here.background - background).abs()
    } else {
        of(&|t| (t.background - here.background).abs()).unwrap_or(0.0)
    };
    let mut light = [0, 1].map(|k| EXPOSURE_LEVELS[k].max(EXPOSURE_SHARE[k] * contrast));
    if !is_near {
        light[0] = light[1].min(FAR_LIGHT * light[0]);
    }
    if others.len() == 1 {
        // Which of the two is the wrong one is not known; where its full pixels show it, the next check finds it.
        light[1] = f64::INFINITY;
    }
    vec![
        Check::at_most("exposure", apart, "grey levels", light).or(|| {
            format!(
                "the background is at {:.0}, beside the grain in {whose} views at {background:.0}: keep lamp, exposure \
                 time and white balance fixed, and shade the stage from other light",
                here.background
            )
        }),
        Check::at_most("clipping_change", 100.0 * (here.full_share - full), "points", FULL_POINTS).or(|| {
            format!(
                "{:.0} % of the lit side of the outline is full, in {whose} views {:.0} %: keep lamp and exposure \
                 time fixed",
                100.0 * here.full_share,
                100.0 * full
            )
        }),
    ]
}

/// A figure that is a support function of the stage's angle.
#[derive(Clone, Copy, PartialEq)]
enum Series {
    Area,
    Left,
    Right,
}

/// A view's figure at an angle.
#[derive(Debug, Clone, Copy)]
struct Point {
    /// Position in the list of views.
    view: usize,
    deg: f64,
    value: f64,
}

impl Series {
    const ALL: [Self; 3] = [Self::Area, Self::Left, Self::Right];

    fn name(self) -> &'static str {
        match self {
            Self::Area => "area",
            Self::Left => "left",
            Self::Right => "right",
        }
    }

    /// The figures of all views with an angle, in the order of the angles. Reaches count from the middle of all views:
    /// that it is not the axis adds 1 − 1/cos of the step times the difference, less than a hundredth of it.
    fn points(self, views: &[ViewTraits]) -> Vec<Point> {
        let n = views.len().max(1) as f64;
        let middle = views.iter().map(|v| 0.5 * (v.traits.columns[0] + v.traits.columns[1])).sum::<f64>() / n;
        let value = |t: &Traits| match self {
            Self::Area => t.filled_px,
            Self::Left => middle - t.columns[0],
            Self::Right => t.columns[1] - middle,
        };
        let point = |(view, v): (usize, &ViewTraits)| {
            v.angle_deg.map(|deg| Point { view, deg, value: value(v.traits) })
        };
        let mut points: Vec<Point> = views.iter().enumerate().filter_map(point).collect();
        points.sort_by(|a, b| a.deg.total_cmp(&b.deg));
        points
    }

    /// What the bounds may be broken by before a view is doubtful, and bad: in the figure's unit.
    fn limits(self, views: &[ViewTraits]) -> [f64; 2] {
        let n = views.len().max(1) as f64;
        let mean = |f: fn(&Traits) -> f64| views.iter().map(|v| f(v.traits)).sum::<f64>() / n;
        let width = mean(|t| t.columns[1] - t.columns[0]);
        [0, 1].map(|k| match self {
            Self::Area => {
                let area = mean(|t| t.filled_px);
                AREA_SHARE[k] * area + AREA_MORE_PX[k] * 2.0 * (std::f64::consts::PI * area).sqrt()
            }
            _ => REACH_SHARE[k] * width + REACH_MORE_PX[k],
        })
    }

    /// By how much a view lies beyond what the rest allows, where the rest sets a bound; nothing where it is not
    /// `suspect`, because then it is the other view of a broken pair that is wrong.
    fn check(self, rest: &[Point], point: &Point, views: &[ViewTraits], suspect: bool) -> Option<Check> {
        let [least, greatest] = bounds(rest, point.deg);
        if least.is_none() && greatest.is_none() {
            return None;
        }
        let below = least.map_or(0.0, |l| (l - point.value) / EXTRAPOLATED);
        let above = greatest.map_or(0.0, |g| point.value - g);
        let is_less = below > above;
        let times = if is_less { EXTRAPOLATED } else { 1.0 };
        let beyond = if suspect { times * below.max(above).max(0.0) } else { 0.0 };
        let whole = views.iter().map(|v| v.traits.filled_px).sum::<f64>() / views.len().max(1) as f64;
        let limits = self.limits(views).map(|l| times * l);
        let what = if is_less { "less" } else { "more" };
        let nearest = nearest(rest, point, views);
        Some(match self {
            Self::Area => {
                Check::at_most(self.name(), 100.0 * beyond / whole, "%", limits.map(|l| 100.0 * l / whole)).or(|| {
                    format!(
                        "the silhouette has {what} area ({:.0} px²) than a body that turns can show beside {nearest}: look \
                         at the outline, the light, and for something that hangs into the picture",
                        point.value
                    )
                })
            }
            _ => Check::at_most(self.name(), beyond, "px", limits).or(|| {
                format!(
                    "the outline reaches {what} far {} than a body that turns can beside {nearest}: look whether the \
                     camera or the table was pushed, and at the outline",
                    self.name()
                )
            }),
        })
    }
}

/// The names of the views beside one.
fn nearest(points: &[Point], point: &Point, views: &[ViewTraits]) -> String {
    let away = |p: &Point| (p.deg - point.deg).abs();
    let mut near: Vec<&Point> = points.iter().filter(|p| p.view != point.view).collect();
    near.sort_by(|a, b| away(a).total_cmp(&away(b)));
    let mut names: Vec<usize> = near.iter().take(2).map(|p| views[p.view].index).collect();
    names.sort_unstable();
    names.iter().map(|n| format!("view {n}")).collect::<Vec<_>>().join(" and ")
}

/// The nearest point before or behind an angle (`sign` −1 or 1), within reach; `points` are in the order of angles.
fn next(points: &[Point], deg: f64, sign: f64) -> Option<(f64, Point)> {
    let point = if sign > 0.0 {
        points.get(points.partition_point(|p| p.deg < deg + NEAREST_DEG))
    } else {
        points[..points.partition_point(|p| p.deg <= deg - NEAREST_DEG)].last()
    }?;
    let gap = sign * (point.deg - deg);
    (gap <= FURTHEST_DEG).then_some((gap, *point))
}

/// What a support function can be at an angle, given its other points: least from the extrapolation of two points on
/// one side, greatest from the two beside it.
fn bounds(points: &[Point], deg: f64) -> [Option<f64>; 2] {
    let sin = |deg: f64| deg.to_radians().sin();
    let [before, behind] = [-1.0, 1.0].map(|sign| next(points, deg, sign));
    let greatest =
        before.zip(behind).map(|((a, p), (b, q))| (p.value * sin(b) + q.value * sin(a)) / sin(a + b));
    let mut least: Option<f64> = None;
    for (sign, near) in [(-1.0, before), (1.0, behind)] {
        let Some((a, p)) = near else { continue };
        let Some((b, q)) = next(points, p.deg, sign) else { continue };
        // Further away than the two are apart, their noise counts too much.
        if a <= 2.1 * b {
            let bound = (p.value * sin(a + b) - q.value * sin(a)) / sin(b);
            least = Some(least.map_or(bound, |l| l.max(bound)));
        }
    }
    [least, greatest]
}

/// By how much a point exceeds what the points beside it allow, beyond the tolerance.
fn excess(points: &[Point], p: &Point, tolerance: f64) -> f64 {
    bounds(points, p.deg)[1].map_or(0.0, |greatest| (p.value - greatest - tolerance).max(0.0))
}

/// The views without which the rest keeps its bounds, the one that breaks most first.
///
/// A value that is too great breaks its own bound, one that is too small its neighbours': each is tried by leaving it
/// out. Costs the square of the number of views where bounds are broken.
fn outliers(points: &[Point], tolerance: f64) -> Vec<usize> {
    let broken = |points: &[Point]| points.iter().map(|p| excess(points, p, tolerance)).sum::<f64>();
    let mut rest = points.to_vec();
    let mut found = Vec::new();
    let mut left = broken(&rest);
    while left > 0.0 {
        let worst = (0..rest.len()).filter(|&k| excess(&rest, &rest[k], tolerance) > 0.0);
        let tried: BTreeSet<usize> =
            worst.flat_map(|k| k.saturating_sub(1)..(k + 2).min(rest.len())).collect();
        let without = |k: usize| {
            let mut others = rest.clone();
            others.remove(k);
            broken(&others)
        };
        // At an end of the row leaving out any of three may do: then it is the one that breaks its own bound.
        let keeps = |k: usize| excess(&rest, &rest[k], tolerance) <= 0.0;
        let best = (tried.into_iter().map(|k| (k, without(k))))
            .min_by(|a, b| a.1.total_cmp(&b.1).then(keeps(a.0).cmp(&keeps(b.0))));
        let Some((k, less)) = best.filter(|b| b.1 < left) else { return Vec::new() };
        if (found.len() + 1) as f64 > MOST_OUTLIERS * points.len() as f64 {
            return Vec::new();
        }
        left = less;
        found.push(rest.remove(k).view);
    }
    found
}
