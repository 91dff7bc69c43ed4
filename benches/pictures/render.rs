//! A set's folder: pictures, what an operator knows, and the truth.

use super::chance::Chance;
use super::develop::{Backdrop, encode};
use super::ideal::hull_mm3;
use super::plan::{Material, Row, Skin};
use super::scene::Scene;
use super::shape::{self, Body};
use super::view::View;
use anyhow::{Context as _, Result, bail};
use grainrig_core::formats::stl;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Raised where the same row gives other pictures or another truth.
const RENDERER: u32 = 1;
/// Views over half a turn; one more closes it.
pub const VIEWS: usize = 25;
/// The stage's step, degrees.
pub const STEP_DEG: f64 = 180.0 / VIEWS as f64;
/// The first view after a slip.
pub const SLIPPED: usize = 13;
const BALL_MM: f64 = 1.0;
/// Every so many views there is one with a ball.
const BALL_VIEWS: usize = 5;

/// A set that has been rendered.
pub struct Rendered {
    /// Its folder.
    pub folder: PathBuf,
    /// `truth/truth.json`.
    pub truth: Value,
}

impl Rendered {
    /// A figure of the truth.
    pub fn number(&self, key: &str) -> f64 {
        self.truth[key].as_f64().unwrap_or(f64::NAN)
    }

    /// The camera of each view.
    ///
    /// # Errors
    /// Where the table of angles cannot be read.
    pub fn views(&self, row: &Row) -> Result<Vec<View>> {
        let table = std::fs::read_to_string(self.folder.join("truth/true_angles.csv"))?;
        (table.lines().skip(1))
            .map(|line| {
                let cells: Vec<f64> = line.split(',').map(str::parse).collect::<Result<_, _>>()?;
                let [_, angle, wobble] = cells[..] else { bail!("{line:?} is not a view") };
                Ok(View::new(row, angle, wobble))
            })
            .collect()
    }
}

/// The file name of a picture.
pub fn file_name(row: &Row, stem: &str) -> String {
    format!("{stem}.{}", if row.file.quality == 0 { "png" } else { "jpg" })
}

/// The set's folder, rendered where it is not there yet or its row has changed. A set with a slip takes the views before
/// it from the set without.
///
/// # Errors
/// Where the shapes cannot be read or the folder not be written; where the grain leaves the picture.
pub fn rendered(row: &Row, sets: &Path, grains: &Path) -> Result<Rendered> {
    let name = if row.slip_deg == 0.0 { row.name.to_owned() } else { format!("{}+slip", row.name) };
    let folder = sets.join(&name);
    let plan = json!({ "renderer": RENDERER, "row": row });
    if let Ok(bytes) = std::fs::read(folder.join("truth/truth.json"))
        && let Ok(truth) = serde_json::from_slice::<Value>(&bytes)
        && truth["plan"] == plan
    {
        return Ok(Rendered { folder, truth });
    }
    let making = sets.join(format!(".{name}.{}", std::process::id()));
    std::fs::create_dir_all(making.join("truth"))?;
    let before = (row.slip_deg != 0.0).then(|| sets.join(row.name));
    let truth = write(row, &making, grains, &plan, before.as_deref()).with_context(|| name.clone());
    let truth = truth.inspect_err(|_| drop(std::fs::remove_dir_all(&making)))?;
    if folder.exists() {
        std::fs::remove_dir_all(&folder)?;
    }
    std::fs::rename(&making, &folder).with_context(|| format!("cannot make {}", folder.display()))?;
    Ok(Rendered { folder, truth })
}

/// One picture of a set, as the bytes of its file; nothing is written.
///
/// # Errors
/// Where the shapes cannot be read.
pub fn one_picture(row: &Row, angle_deg: f64, grains: &Path) -> Result<Vec<u8>> {
    let body = shape::placed(row, grains)?;
    let scene = Scene::new(row, Some(&body));
    let backdrop = Backdrop::new(row, scene.reach.0 / row.mm_per_px());
    let traced = scene.trace(&View::new(row, angle_deg, 0.0));
    backdrop.develop(row, &traced, &mut Chance::new(row.seed, "one"))
}

fn write(row: &Row, folder: &Path, grains: &Path, plan: &Value, before: Option<&Path>) -> Result<Value> {
    let body = shape::placed(row, grains)?;
    let scene = Scene::new(row, Some(&body));
    let mut chance = Chance::new(row.seed, "stage");
    let views: Vec<View> = (0..=VIEWS)
        .map(|k| {
            let slip = if k >= SLIPPED { row.slip_deg } else { 0.0 };
            let angle = k as f64 * STEP_DEG + row.step_sd_deg * chance.normal() + slip;
            View::new(row, angle, row.wobble_sd_px * chance.normal())
        })
        .collect();
    let backdrop = Backdrop::new(row, scene.reach.0 / row.mm_per_px());
    let size = [row.camera.width, row.camera.height];
    let save = |stem: &str, scene: &Scene, view: &View| -> Result<()> {
        let bytes = backdrop.develop(row, &scene.trace(view), &mut Chance::new(row.seed, stem))?;
        Ok(std::fs::write(folder.join(file_name(row, stem)), bytes)?)
    };
    let masks = views.par_iter().enumerate().map(|(k, view)| {
        let coverage = scene.coverage(view, &body);
        let mask: Vec<u8> = coverage.iter().map(|c| (255.0 * c).round() as u8).collect();
        std::fs::write(folder.join(format!("truth/mask_{k:02}.png")), encode(&mask, size, 0)?)?;
        let [w, h] = size;
        let is_cut = (0..w).any(|x| coverage[x] > 0.0 || coverage[(h - 1) * w + x] > 0.0)
            || (0..h).any(|y| coverage[y * w] > 0.0 || coverage[y * w + w - 1] > 0.0);
        if is_cut {
            bail!("the grain reaches the border of view {k}");
        }
        let stem = format!("grain_{k:02}");
        match before.filter(|_| k < SLIPPED) {
            Some(before) => {
                let name = file_name(row, &stem);
                std::fs::copy(before.join(&name), folder.join(name))?;
            }
            None => save(&stem, &scene, view)?,
        }
        Ok(coverage)
    });
    let masks: Vec<Vec<f32>> = masks.collect::<Result<_>>()?;
    let empty = Row { wobble_sd_px: 0.0, ..row.clone() };
    save("empty", &Scene::new(&empty, None), &View::new(row, 0.0, 0.0))?;
    if row.has_balls {
        save_balls(row, &views, &save)?;
    }
    let ideal = hull_mm3(&body, &views[..VIEWS], &masks[..VIEWS], size);
    let mut operator = json!({
        "nominal_step_deg": STEP_DEG,
        "images": VIEWS + 1,
        "closing_view": VIEWS,
        "mm_per_px": row.mm_per_px(),
        "note": "synthetic, traced by rays",
    });
    if row.camera.distance_mm > 0.0 {
        operator["lens_to_axis_distance_mm_nominal"] = row.camera.distance_mm.into();
    }
    if row.has_balls {
        operator["ball_diameter_mm"] = BALL_MM.into();
    }
    let [axis_u, row0] = row.foot_px();
    let camera = &row.camera;
    let truth = json!({
        "plan": plan,
        "volume_mm3": body.mesh.volume_mm3(),
        "volume_above_pedestal_mm3": body.mesh.volume_above_zero_mm3(),
        "ideal_hull_mm3": ideal,
        "height_above_pedestal_mm": scene.reach.2,
        "lowest_mm": scene.reach.1,
        "pedestal_mm": row.pedestal.diameter_mm,
        "mm_per_px": row.mm_per_px(),
        "axis_u": axis_u,
        "row0": row0,
        "width": camera.width,
        "height": camera.height,
        "distance": camera.distance_mm,
        "pitch": camera.pitch_deg,
        "roll": camera.roll_deg,
        "views": VIEWS,
    });
    let mut table = String::from("view,angle_deg,wobble_px\n");
    for (k, view) in views.iter().enumerate() {
        writeln!(table, "{k},{},{}", view.angle_deg, view.wobble_px)?;
    }
    std::fs::write(folder.join("truth/true_angles.csv"), table)?;
    let mut surface = Vec::new();
    stl::write(&body.mesh, &mut surface)?;
    std::fs::write(folder.join("truth/truth_mesh_table_frame.stl"), surface)?;
    std::fs::write(folder.join("capture.json"), serde_json::to_vec_pretty(&operator)?)?;
    std::fs::write(folder.join("truth/truth.json"), serde_json::to_vec_pretty(&truth)?)?;
    Ok(truth)
}

type Save<'a> = dyn Fn(&str, &Scene, &View) -> Result<()> + Sync + 'a;

/// Pictures of a matt ball on the same pedestal.
fn save_balls(row: &Row, views: &[View], save: &Save) -> Result<()> {
    let skin = Skin { albedo: 0.35, mottle: 0.0, bump: 0.0, second: None, ..row.skin };
    let row = Row { material: Material::Opaque, skin, ..row.clone() };
    let ball: Body = shape::ball(BALL_MM, [0.02, -0.03]);
    let scene = Scene::new(&row, Some(&ball));
    (0..VIEWS)
        .into_par_iter()
        .filter(|k| k % BALL_VIEWS == 0)
        .try_for_each(|k| save(&format!("ball_{k:02}"), &scene, &views[k]))
}
