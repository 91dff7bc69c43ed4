//! Views stream through: decoded and cut out on worker threads, carved into a live hull as they come.

use super::agree::{Decision, take_rim};
use super::pedestal;
use super::quality::compare;
use super::reconstruct::{Reconstruction, SegmentedView, provisional_camera, reconstruct};
use super::{Cameras, PipelineError, Settings, ViewFault};
use crate::session::event::{CapturedView, EventKind, Role};
use crate::trace::ms_since;
use grainrig_core::calibrate::Turntable;
use grainrig_core::formats::Photograph;
use grainrig_core::geometry::{Aabb, Angle, Point};
use grainrig_core::hull::{Cone, HullGrid};
use grainrig_core::report::Shot;
use grainrig_core::silhouette::{self, Known, PedestalConsensus, Segmentation, Source, Traits, ViewQuality};
use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;
use tracing::{Span, debug, debug_span};

/// Cells of the live hull along the grain's height: enough for a number and a picture, quick to carve.
const LIVE_CELLS: f64 = 96.0;
/// Results that may wait for the live hull before the workers do.
const WAITING_RESULTS: usize = 2;

/// Told of what happens, from any thread.
pub type Observer<'a> = dyn Fn(EventKind) + Sync + 'a;

/// A view's place in the order of arrival, its index, and what became of it.
type Outcome = (usize, usize, Result<SegmentedView, PipelineError>);

/// Views in the plan's order, the pedestal that they share, and what a person should know.
pub(super) type CutViews = (Vec<SegmentedView>, Option<PedestalConsensus>, Vec<String>);

/// One view on its way in: what a session has recorded, and nothing else. There is one way to make it, so that a live
/// run and a replay of it compute from the same numbers.
#[derive(Debug, Clone)]
pub struct View {
    index: usize,
    role: Role,
    angle: Angle,
    bytes: Vec<u8>,
    segmented: Option<Box<SegmentedPicture>>,
}

impl View {
    /// The view that a journal's record and the bytes of its picture file make.
    pub fn recorded(captured: &CapturedView, bytes: Vec<u8>) -> Self {
        let angle = Angle::from_deg(captured.reached_deg);
        Self { index: captured.view, role: captured.role, angle, bytes, segmented: None }
    }

    /// With what a [`Gate`](super::Gate) has worked out already about the same bytes.
    pub(super) fn with(self, segmented: SegmentedPicture) -> Self {
        Self { segmented: Some(Box::new(segmented)), ..self }
    }

    /// Its place for the views beside it: index and angle.
    pub(super) fn place(&self) -> (usize, Angle) {
        (self.index, self.angle)
    }

    /// The picture file's bytes.
    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes
    }
}

/// What a picture's bytes say by themselves, whichever view they are of.
#[derive(Debug, Clone)]
pub struct SegmentedPicture {
    found: Segmentation,
    shot: Option<Shot>,
    quality: Option<ViewQuality>,
    traits: Option<Traits>,
    seconds: f64,
}

impl SegmentedPicture {
    /// What is wrong with the picture by itself, if anything is.
    pub(super) fn quality(&self) -> Option<&ViewQuality> {
        self.quality.as_ref()
    }

    /// Its figures, to be compared with other views'.
    pub(super) fn traits(&self) -> Option<&Traits> {
        self.traits.as_ref()
    }

    /// The outline, and how it was got.
    pub(super) fn found_mut(&mut self) -> &mut Segmentation {
        &mut self.found
    }

    /// Notes what all views decided on the tone curve.
    pub(super) fn take_decision(&mut self, decision: &Decision) {
        if let Some(from) = decision.from {
            self.found.report.tone_curve_from = from;
        }
    }

    /// As the cut-out of a view.
    fn of(self, view: View) -> SegmentedView {
        SegmentedView {
            index: view.index,
            role: view.role,
            angle: view.angle,
            bytes: view.bytes,
            silhouette: Arc::new(self.found.silhouette.clone()),
            found: self.found,
            shot: self.shot,
            quality: self.quality,
            traits: self.traits,
            seconds: self.seconds,
        }
    }
}

impl SegmentedView {
    /// Takes over the outline that was found last.
    pub(super) fn take_outline(&mut self) {
        self.silhouette = Arc::new(self.found.silhouette.clone());
        if let Some(traits) = &mut self.traits {
            traits.take_outline(&self.silhouette);
        }
    }

    /// Cut out otherwise.
    pub(super) fn replace(&mut self, by: SegmentedPicture) {
        let SegmentedPicture { found, shot, quality, traits, seconds } = by;
        self.silhouette = Arc::new(found.silhouette.clone());
        self.seconds += seconds;
        (self.found, self.shot, self.quality, self.traits) = (found, shot, quality, traits);
    }
}

/// The computation of one session.
#[derive(Debug, Clone)]
pub struct Pipeline {
    /// What a person set.
    pub settings: Settings,
    /// Where the views' cameras come from.
    pub cameras: Cameras,
    /// A picture of the stage without the grain, where there is one.
    pub background: Option<Photograph>,
    /// Views in the plan.
    pub views: usize,
    /// A full step of the motor that turned the grain, degrees: what is lost with a step.
    pub full_step_deg: f64,
    /// Whether the views' quality is judged.
    pub judges: bool,
}

impl Pipeline {
    /// Takes views until the sender is gone, then computes hull and mesh.
    ///
    /// Memory is bounded: at most one picture is decoded per worker, the rest wait as the camera's own bytes in
    /// the caller's bounded channel.
    ///
    /// # Errors
    /// [`PipelineError`], at the first view that can't be used; the views' files are not touched.
    pub fn run(&self, views: Receiver<View>, observer: &Observer) -> Result<Reconstruction, PipelineError> {
        self.settings.check()?;
        if let Cameras::Turntable(t) = &self.cameras {
            t.check()?;
        }
        let (mut segmented, consensus, warnings) = self.cut(views, observer)?;
        let told = compare(&self.cameras, &mut segmented, observer);
        let cameras = (&self.cameras, self.full_step_deg);
        let mut made = reconstruct(&self.settings, cameras, &segmented, (consensus, warnings), observer)?;
        made.warnings.extend(told);
        Ok(made)
    }

    /// Cuts out all views, by what they say together: each as it comes, then by one decision for all of them, at the pedestal that they
    /// share, and with what the others hold of it. The views in the plan's order, the pedestal, and what a person should know.
    pub(super) fn cut(&self, views: Receiver<View>, observer: &Observer) -> Result<CutViews, PipelineError> {
        let mut segmented = self.take(views, observer)?;
        if segmented.len() < self.views {
            return Err(PipelineError::MissingViews { got: segmented.len(), expected: self.views });
        }
        segmented.sort_by_key(|t| t.index);
        let decision = self.agree(&mut segmented)?;
        let (consensus, warnings) = pedestal::recut(&self.cameras, &mut segmented)?;
        let rim_px = take_rim(&mut segmented);
        self.hold(&mut segmented, (&decision, consensus.as_ref(), rim_px));
        Ok((segmented, consensus, warnings))
    }

    /// Cuts out all views, in the order in which they come.
    fn take(&self, views: Receiver<View>, observer: &Observer) -> Result<Vec<SegmentedView>, PipelineError> {
        let workers = std::thread::available_parallelism().map_or(1, std::num::NonZero::get).min(4);
        let views = Mutex::new((0, views));
        std::thread::scope(|scope| {
            let (send, receive) = sync_channel(WAITING_RESULTS);
            for _ in 0..workers {
                let (send, views, span) = (send.clone(), &views, Span::current());
                scope.spawn(move || span.in_scope(|| self.work(views, &send)));
            }
            drop(send);
            let mut live = Live::default();
            let mut segmented: Vec<SegmentedView> = Vec::new();
            // In the order in which the views came, whoever is done first: what is told is the same each time.
            let mut early = BTreeMap::new();
            for (place, view, one) in receive {
                early.insert(place, (view, one));
                while let Some((view, one)) = early.remove(&segmented.len()) {
                    let one = one.inspect_err(|error| {
                        // Said at once: the run goes on, and ends with this error.
                        observer(EventKind::Rejected { view, tries: None, cause: error.to_string() });
                    })?;
                    self.accept(one, &mut segmented, &mut live, observer)?;
                }
            }
            Ok(segmented)
        })
    }

    /// Takes one more view's outline: into the live hull, and to those that wait for all of them.
    fn accept(
        &self,
        one: SegmentedView,
        segmented: &mut Vec<SegmentedView>,
        live: &mut Live,
        observer: &Observer,
    ) -> Result<(), PipelineError> {
        let picture = one.found.silhouette.picture;
        if let Some(first) = segmented.first().map(|t| t.found.silhouette.picture)
            && first != picture
        {
            return Err(PipelineError::Size {
                view: one.index,
                width: picture[0],
                height: picture[1],
                expected_width: first[0],
                expected_height: first[1],
            });
        }
        let mut warnings = one.found.report.warnings.clone();
        warnings.extend(one.quality.iter().flat_map(ViewQuality::warnings));
        observer(EventKind::Silhouette {
            view: one.index,
            area_px: one.found.report.area_px,
            verdict: one.quality.as_ref().map(|q| q.verdict),
            warnings,
        });
        if one.role == Role::Grain {
            live.add(&self.cameras, &one, observer)?;
        }
        segmented.push(one);
        Ok(())
    }

    /// Decodes and cuts out views until there are none, or nobody wants the results.
    fn work(&self, views: &Mutex<(usize, Receiver<View>)>, send: &SyncSender<Outcome>) {
        loop {
            let mut queue = views.lock().unwrap_or_else(PoisonError::into_inner);
            let Ok(mut view) = queue.1.recv() else { return };
            let place = queue.0;
            queue.0 += 1;
            drop(queue);
            let segmented = match view.segmented.take() {
                Some(segmented) => Ok(*segmented),
                None => debug_span!("view", index = view.index, angle_deg = view.angle.deg())
                    .in_scope(|| self.segment(view.index, &view.bytes)),
            };
            let index = view.index;
            if send.send((place, index, segmented.map(|it| it.of(view)))).is_err() {
                return;
            }
        }
    }

    /// Decodes a picture, finds its silhouette and judges it. The view's index is for messages.
    pub(super) fn segment(&self, view: usize, bytes: &[u8]) -> Result<SegmentedPicture, PipelineError> {
        self.segment_with(view, bytes, &self.settings.silhouette, &Known::default())
    }

    /// The same with other settings, and with what the other views say.
    pub(super) fn segment_with(
        &self,
        view: usize,
        bytes: &[u8],
        settings: &silhouette::Settings,
        known: &Known<'_>,
    ) -> Result<SegmentedPicture, PipelineError> {
        let start = Instant::now();
        let ended = self.found(view, bytes, (settings, known), start);
        let ms = ms_since(start);
        match &ended {
            Ok(it) => debug!(ms, outcome = "found", area_px = it.found.report.area_px, "silhouette"),
            Err(error) => debug!(ms, outcome = "failed", %error, "silhouette"),
        }
        ended
    }

    fn found(
        &self,
        view: usize,
        bytes: &[u8],
        (settings, known): (&silhouette::Settings, &Known<'_>),
        start: Instant,
    ) -> Result<SegmentedPicture, PipelineError> {
        let picture = Photograph::open(bytes)
            .map_err(|reason| ViewFault::Decode { bytes: bytes.len(), reason }.of(view))?;
        let background = self.background.as_ref().map(|stage| stage as &dyn Source);
        let found = silhouette::find_with(&picture, background, settings, known)
            .map_err(|source| ViewFault::Silhouette(source).of(view))?;
        // Given cameras say what the picture covers; before a turntable the whole grain must be seen.
        if matches!(self.cameras, Cameras::Turntable(_)) {
            let sides = silhouette::Side::ALL.iter().zip(found.report.touches_border);
            // Whether a pedestal or the grain reaches the lower border is known when all views are in.
            let sides = sides.filter(|s| s.1 && *s.0 != silhouette::Side::Bottom);
            if let Some(side) = sides.map(|s| s.0.name()).next() {
                return Err(ViewFault::CutByBorder { side }.of(view));
            }
        }
        let (quality, traits) = self
            .judges
            .then(|| {
                let (mut quality, traits) = silhouette::assess(&picture, &found);
                if matches!(self.cameras, Cameras::Turntable(_)) {
                    // None of the other ends is reached, as seen above.
                    quality.state_border([false; 4]);
                }
                (quality, traits)
            })
            .map_or((None, None), |(q, t)| (Some(q), Some(t)));
        Ok(SegmentedPicture {
            shot: self.settings.report.pictures.then(|| Shot::of(&picture, &found.silhouette)),
            found,
            quality,
            traits,
            seconds: start.elapsed().as_secs_f64(),
        })
    }
}

/// The live hull: carved with the camera that is known so far, for the monitor only.
#[derive(Default)]
struct Live {
    grid: Option<(HullGrid, Turntable)>,
}

impl Live {
    fn add(
        &mut self,
        cameras: &Cameras,
        view: &SegmentedView,
        observer: &Observer,
    ) -> Result<(), PipelineError> {
        // Given cameras bound the hull only together: their hull is carved at the end.
        let Cameras::Turntable(table) = cameras else { return Ok(()) };
        if self.grid.is_none() {
            let camera = provisional_camera(table, view);
            let s = &view.silhouette;
            let mm = table.mm_per_px;
            let (top, low) = (s.origin[1] as f64, (s.origin[1] + s.size[1]) as f64);
            let reach = |column: usize| (column as f64 - camera.axis_column_px).abs();
            let half = reach(s.origin[0]).max(reach(s.origin[0] + s.size[0])).max(low - top) * mm * 1.5;
            let z = |row: f64| (camera.origin_row_px - row) * mm;
            let margin = 0.1 * (low - top) * mm;
            let bounds = Aabb {
                min: Point::new(-half, -half, z(low) - margin),
                max: Point::new(half, half, z(top) + margin),
            };
            let pitch = (bounds.size().max() / LIVE_CELLS).max(mm);
            self.grid = Some((HullGrid::new(&bounds, pitch)?, camera));
        }
        if let Some((grid, camera)) = &mut self.grid {
            let angle = if table.clockwise { -view.angle } else { view.angle };
            grid.carve(&Cone::new(camera.view(angle, 0.0), Arc::clone(&view.silhouette)));
            // One view bounds nothing along its own direction.
            let volume_mm3 = (grid.views() > 1).then(|| grid.measures().volume_mm3);
            observer(EventKind::Hull { views: grid.views(), volume_mm3 });
        }
        Ok(())
    }
}
