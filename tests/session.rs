//! The journal and the folder of a session: whatever happens to the bytes, what is read is what was written.

use grainrig::rig::{Encoding, Frame, OtherFile};
use grainrig::session::event::{CapturedView, EventKind, Role};
use grainrig::session::import::{ImportRequest, scan};
use grainrig::session::journal::{Chain, Decoder};
use grainrig::session::{
    Fault, Manifest, Origin, Plan, PlannedView, Recording, Session, SessionError, State, Store, check_name,
    check_space, free_bytes, required_bytes, verify,
};
use grainrig_core::geometry::Angle;
use image::{DynamicImage, ImageFormat, RgbImage};
use proptest::prelude::*;
use std::io::{Cursor, Write as _};
use std::path::Path;
use tempfile::TempDir;

fn manifest(views: usize) -> Manifest {
    let view = |index| PlannedView {
        index,
        role: Role::Grain,
        angle_deg: index as f64 * 7.2,
        steps: Some(index as i64 * 8),
    };
    let plan = Plan { views: (0..views).map(view).collect(), settle_ms: 0, retakes: 0, tolerance_deg: 0.45 };
    Manifest::new("a", Origin::Rig, plan, serde_json::Value::Null)
}

fn store() -> (TempDir, Store) {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::new(dir.path().join("data"));
    (dir, store)
}

fn frame(shade: u8) -> Frame {
    let mut out = Cursor::new(Vec::new());
    let picture = RgbImage::from_pixel(16, 8, image::Rgb([shade; 3]));
    DynamicImage::from(picture).write_to(&mut out, ImageFormat::Png).unwrap();
    Frame::new(out.into_inner(), Encoding::Png)
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

fn happening() -> impl Strategy<Value = EventKind> {
    let number = || -1e12..1e12f64;
    prop_oneof![
        Just(EventKind::Homed),
        Just(EventKind::Paused),
        Just(EventKind::Aborted),
        (any::<String>(), any::<usize>()).prop_map(|(session, views)| EventKind::Started {
            session,
            views,
            already_captured: views / 2
        }),
        (0..999usize, number()).prop_map(|(view, target_deg)| EventKind::Moving { view, target_deg }),
        (0..999usize, any::<String>(), number(), proptest::option::of(number())).prop_map(
            |(view, file, deg, remaining_s)| EventKind::Captured {
                view: CapturedView {
                    view,
                    role: Role::Closing,
                    file,
                    bytes: view as u64,
                    sha256: "0".repeat(64),
                    commanded_deg: deg,
                    reached_deg: -deg,
                    others: Vec::new(),
                },
                remaining_s,
            }
        ),
        (0..999usize, number(), proptest::collection::vec(any::<String>(), 0..3)).prop_map(
            |(view, area_px, warnings)| EventKind::Silhouette { view, area_px, verdict: None, warnings }
        ),
        any::<String>().prop_map(|error| EventKind::Failed { error }),
    ]
}

/// A journal's bytes, where each line ends, and the events as a reader gets them.
fn written(happenings: Vec<EventKind>) -> (Vec<u8>, Vec<usize>, Vec<EventKind>) {
    let mut chain = Chain::new(b"manifest");
    let (mut bytes, mut ends, mut events) = (Vec::new(), vec![0], Vec::new());
    for what in happenings {
        let record = chain.encode(jiff::Timestamp::UNIX_EPOCH, what).unwrap();
        chain.advance(&record);
        bytes.extend(record.line.as_bytes());
        ends.push(bytes.len());
        events.push(record.event.what);
    }
    (bytes, ends, events)
}

/// What a reader gets: the events, whether there is damage, the whole bytes and those of a torn line.
fn read_back(bytes: &[u8], chunk: usize) -> (Vec<EventKind>, bool, u64, usize) {
    let mut decoder = Decoder::new(Chain::new(b"manifest"));
    let (mut events, mut damaged) = (Vec::new(), false);
    for part in bytes.chunks(chunk.max(1)) {
        decoder.push(part);
        while let Some(next) = decoder.next() {
            match next {
                Ok(record) => events.push(record.event.what),
                Err(_) => damaged = true,
            }
        }
    }
    let (_, whole, torn) = decoder.finish();
    (events, damaged, whole, torn)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_journal_reads_back_in_pieces_of_any_size(
        happenings in proptest::collection::vec(happening(), 0..8), chunk in 1..4000usize
    ) {
        let (bytes, _, events) = written(happenings);
        prop_assert_eq!(read_back(&bytes, chunk), (events, false, bytes.len() as u64, 0));
    }

    #[test]
    fn a_journal_cut_anywhere_keeps_exactly_its_whole_lines(
        happenings in proptest::collection::vec(happening(), 1..8), cut in any::<prop::sample::Index>()
    ) {
        let (bytes, ends, events) = written(happenings);
        let cut = cut.index(bytes.len());
        let whole = ends.iter().rposition(|end| *end <= cut).unwrap();
        let expected = (events[..whole].to_vec(), false, ends[whole] as u64, cut - ends[whole]);
        prop_assert_eq!(read_back(&bytes[..cut], 64), expected);
    }

    #[test]
    fn a_journal_with_any_one_byte_changed_is_never_taken_for_the_one_written(
        happenings in proptest::collection::vec(happening(), 1..6),
        at in any::<prop::sample::Index>(),
        change in 1..=255u8
    ) {
        let (mut bytes, ends, events) = written(happenings);
        let at = at.index(bytes.len());
        bytes[at] ^= change;
        let line = ends.iter().rposition(|end| *end <= at).unwrap();
        let (read, damaged, whole, torn) = read_back(&bytes, 4096);
        // The lines before the change are as they were; from there on nothing is believed.
        prop_assert_eq!(&read, &events[..line]);
        prop_assert_eq!(whole, ends[line] as u64);
        // The last line's end, gone, makes it a torn one: the same as if it had never been finished.
        let is_last_end = at == bytes.len() - 1;
        prop_assert_eq!((damaged, torn > 0), if is_last_end { (false, true) } else { (true, torn > 0) });
    }

    #[test]
    fn a_journal_with_lines_taken_out_doubled_or_swapped_is_damaged(
        happenings in proptest::collection::vec(happening(), 3..7), which in any::<prop::sample::Index>()
    ) {
        let (bytes, ends, _) = written(happenings);
        let lines: Vec<&[u8]> = ends.windows(2).map(|e| &bytes[e[0]..e[1]]).collect();
        let n = which.index(lines.len() - 1);
        let mut without = lines.clone();
        without.remove(n);
        let mut doubled = lines.clone();
        doubled.insert(n, lines[n]);
        let mut swapped = lines;
        swapped.swap(n, n + 1);
        for changed in [without, doubled, swapped] {
            prop_assert!(read_back(&changed.concat(), 4096).1);
        }
    }

    #[test]
    fn a_journal_of_garbage_is_read_without_harm(bytes in proptest::collection::vec(any::<u8>(), 0..2000)) {
        let (events, ..) = read_back(&bytes, 100);
        prop_assert!(events.is_empty());
    }

    #[test]
    fn a_name_that_passes_is_a_plain_child_of_the_data_folder(name in "\\PC{0,12}|[a-zA-Z0-9._/\\\\-]{0,70}") {
        if check_name("session name", &name).is_ok() {
            let path = Path::new("data").join(&name);
            prop_assert_eq!(path.parent(), Some(Path::new("data")));
            prop_assert_eq!(path.file_name().and_then(|n| n.to_str()), Some(name.as_str()));
        }
    }
}

#[test]
fn a_torn_line_and_unfinished_files_are_cleared_away_by_the_next_writer_only() {
    let (_dir, store) = store();
    let mut session = store.create(&manifest(3)).unwrap();
    session.record_frame(0, Angle::default(), &frame(1), None).unwrap();
    drop(session);
    let folder = store.folder("a").unwrap();
    let journal = folder.join("journal.jsonl");
    let whole = std::fs::read(&journal).unwrap();
    std::fs::write(&journal, [&whole[..], b"{\"seq\":1,"].concat()).unwrap();
    std::fs::write(folder.join("frames/.view_001.png.77.0.part"), b"half").unwrap();
    // A reader leaves everything as it is.
    let recording = store.read("a").unwrap();
    assert_eq!((recording.torn_bytes(), recording.views().len()), (9, 1));
    assert_eq!(names(&folder.join("frames")).len(), 2);
    let mut session = store.open("a").unwrap();
    assert_eq!(std::fs::read(&journal).unwrap(), whole);
    assert_eq!(names(&folder.join("frames")), ["view_000.png"]);
    session.record_frame(1, Angle::from_deg(7.2), &frame(2), None).unwrap();
    assert!(verify(&folder).unwrap().is_sound());
}

#[test]
fn a_picture_that_was_written_but_not_journalled_is_taken_again_under_its_name() {
    let (_dir, store) = store();
    drop(store.create(&manifest(2)).unwrap());
    let file = store.folder("a").unwrap().join("frames/view_000.png");
    std::fs::write(&file, b"written before the power failed").unwrap();
    assert!(
        verify(&store.folder("a").unwrap()).unwrap().faults[0].to_string().contains("not in the journal")
    );
    let mut session = store.open("a").unwrap();
    session.record_frame(0, Angle::default(), &frame(9), None).unwrap();
    assert_eq!(std::fs::read(&file).unwrap(), frame(9).bytes);
    assert!(verify(&store.folder("a").unwrap()).unwrap().is_sound());
}

#[test]
fn raw_files_are_archived_and_checked_beside_their_picture_and_may_not_name_a_place() {
    let (_dir, store) = store();
    let mut session = store.create(&manifest(2)).unwrap();
    let other = |extension: &str, byte| OtherFile { extension: extension.into(), bytes: vec![byte; 9] };
    let picture = Frame { others: vec![other("cr2", 1), other("cr2", 2), other("xmp", 3)], ..frame(7) };
    let view = session.record_frame(0, Angle::default(), &picture, None).unwrap();
    let files: Vec<&str> = view.others.iter().map(|o| o.file.as_str()).collect();
    assert_eq!(files, ["view_000_raw.cr2", "view_000_raw_2.cr2", "view_000_raw.xmp"]);
    let folder = session.recording().folder().to_owned();
    assert_eq!(std::fs::read(folder.join("frames").join(files[1])).unwrap(), [2; 9]);
    let outside = Frame { others: vec![other("/../../x", 1)], ..frame(8) };
    assert!(session.record_frame(1, Angle::default(), &outside, None).is_err());
    drop(session);
    assert!(verify(&folder).unwrap().is_sound());
    std::fs::write(folder.join("frames/view_000_raw.xmp"), [3; 8]).unwrap();
    let faults = verify(&folder).unwrap().faults;
    assert!(
        matches!(&faults[..], [Fault::Changed { file, .. }] if file == "frames/view_000_raw.xmp"),
        "{faults:?}"
    );
}

#[test]
fn evidence_is_never_overwritten_and_the_plan_is_kept() {
    let (_dir, store) = store();
    let mut session = store.create(&manifest(2)).unwrap();
    session.record_frame(1, Angle::from_deg(7.2), &frame(1), None).unwrap();
    let again = session.record_frame(1, Angle::from_deg(7.2), &frame(2), None).unwrap_err();
    assert!(matches!(again, SessionError::Captured { view: 1, .. }), "{again}");
    let beyond = session.record_frame(2, Angle::default(), &frame(2), None).unwrap_err();
    assert!(matches!(beyond, SessionError::NotPlanned { view: 2, views: 2 }), "{beyond}");
    assert_eq!(session.recording().frame(1).unwrap(), frame(1));
    assert!(matches!(session.recording().frame(0), Err(SessionError::NotCaptured { view: 0, captured: 1 })));
}

#[test]
fn an_event_that_could_not_be_read_back_is_refused_and_the_journal_goes_on() {
    let (_dir, store) = store();
    let mut session = store.create(&manifest(2)).unwrap();
    for bad in [f64::NAN, f64::INFINITY] {
        let error = session.append(EventKind::Moving { view: 0, target_deg: bad }).unwrap_err();
        assert!(matches!(error, SessionError::Unrecordable { .. }), "{error}");
    }
    session.record_frame(0, Angle::from_deg(f64::NAN), &frame(1), None).unwrap_err();
    session.append(EventKind::Homed).unwrap();
    drop(session);
    let recording = store.read("a").unwrap();
    assert_eq!((recording.events().len(), recording.events()[0].seq), (1, 0));
}

#[test]
fn one_writer_at_a_time() {
    let (_dir, store) = store();
    let session = store.create(&manifest(2)).unwrap();
    let error = store.open("a").unwrap_err().to_string();
    assert!(error.contains(&format!("written by process {}", std::process::id())), "{error}");
    assert!(verify(session.recording().folder()).unwrap().busy);
    let listed = store.list().unwrap().remove(0);
    assert_eq!((listed.busy, listed.state), (true, Some(State::Capturing)));
    // A product that is still being written holds the lock too.
    let product = session.product("grain.inp").unwrap();
    drop(session);
    assert!(matches!(store.open("a"), Err(SessionError::Locked { .. })));
    drop(product);
    drop(store.open("a").unwrap());
    assert_eq!(store.list().unwrap()[0].state, Some(State::Created));
}

/// A set of products, all of one text.
fn set(text: &str) -> Vec<(String, Vec<u8>)> {
    ["grain.inp", "grain.stl"].map(|name| (name.to_owned(), text.as_bytes().to_vec())).into()
}

fn put(session: &mut Session, text: &str) {
    session.put_products(&set(text), serde_json::Value::Null, None).unwrap();
}

/// A journal, the folders beside it with what is in them, and what must be the newest set.
type Case<'a> = (&'a [u8], &'a [(&'a str, &'a str)], &'a str);

#[test]
fn a_killed_exchange_of_products_is_finished_or_undone_when_the_session_is_opened() {
    let (_dir, store) = store();
    let mut session = store.create(&manifest(2)).unwrap();
    put(&mut session, "old");
    let folder = session.recording().folder().to_owned();
    let journal = folder.join("journal.jsonl");
    let before = std::fs::read(&journal).unwrap();
    put(&mut session, "new");
    let after = std::fs::read(&journal).unwrap();
    drop(session);
    let fill = |name: &str, text: &str| {
        let place = folder.join(name);
        let _ = std::fs::remove_dir_all(&place);
        std::fs::create_dir(&place).unwrap();
        set(text).iter().for_each(|(file, bytes)| std::fs::write(place.join(file), bytes).unwrap());
    };
    // What a kill leaves: before the record, after it, after the exchange, and between the two renames of a file system
    // that can't exchange folders.
    let cases: [Case; 5] = [
        (&before, &[("products", "old"), ("products.next", "new")], "old"),
        (&after, &[("products", "old"), ("products.next", "new")], "new"),
        (&after, &[("products", "new"), ("products.next", "old")], "new"),
        (&after, &[("products.old", "old"), ("products.next", "new")], "new"),
        (&after, &[("products.old", "old"), ("products", "new")], "new"),
    ];
    for (lines, folders, right) in cases {
        std::fs::write(&journal, lines).unwrap();
        for name in ["products", "products.next", "products.old"] {
            let _ = std::fs::remove_dir_all(folder.join(name));
        }
        folders.iter().for_each(|(name, text)| fill(name, text));
        drop(store.open("a").unwrap());
        assert_eq!(names(&folder.join("products")), ["grain.inp", "grain.stl"], "{folders:?}");
        assert_eq!(
            std::fs::read(folder.join("products/grain.stl")).unwrap(),
            right.as_bytes(),
            "{folders:?}"
        );
        let report = verify(&folder).unwrap();
        assert!(report.is_sound(), "{folders:?}: {:?}", report.faults);
    }
}

#[test]
fn products_that_a_newer_set_lacks_stay() {
    let (_dir, store) = store();
    let mut session = store.create(&manifest(2)).unwrap();
    put(&mut session, "old");
    let one = [("grain.inp".to_owned(), b"new".to_vec())];
    session.put_products(&one, serde_json::Value::Null, None).unwrap();
    let report = verify(session.recording().folder()).unwrap();
    assert_eq!((report.products, report.faults.len()), (2, 0), "{:?}", report.faults);
}

#[test]
fn journal_and_manifest_that_are_removed_in_mid_run_are_put_back_and_others_in_their_place_end_the_run() {
    for file in ["journal.jsonl", "manifest.json"] {
        let (_dir, store) = store();
        let mut session = store.create(&manifest(2)).unwrap();
        let path = session.recording().folder().join(file);
        session.append(EventKind::Homed).unwrap();
        session.append(EventKind::Moving { view: 0, target_deg: 0.0 }).unwrap();
        std::fs::remove_file(&path).unwrap();
        session.append(EventKind::Paused).unwrap();
        session.append(EventKind::Resumed).unwrap();
        assert_eq!(store.read("a").unwrap().events(), session.recording().events(), "{file}");
        std::fs::remove_file(&path).unwrap();
        std::fs::write(&path, b"another").unwrap();
        let error = session.append(EventKind::Paused).unwrap_err();
        assert!(matches!(error, SessionError::Replaced { .. }), "{error}");
        assert_eq!(std::fs::read(&path).unwrap(), b"another");
    }
}

#[test]
fn a_product_appears_whole_or_not_at_all() {
    let (_dir, store) = store();
    let session = store.create(&manifest(2)).unwrap();
    let products = session.recording().folder().join("products");
    let mut begun = session.product("grain.inp").unwrap();
    begun.write_all(b"*NODE").unwrap();
    assert!(names(&products).iter().all(|n| n.starts_with('.')));
    drop(begun);
    assert!(names(&products).is_empty());
    for bad in ["../grain.inp", "", ".grain", "a/b"] {
        assert!(matches!(session.product(bad), Err(SessionError::Name { .. })), "{bad:?}");
    }
}

#[test]
fn a_session_appears_whole_or_not_at_all() {
    let (_dir, store) = store();
    drop(store.stage(&manifest(2)).unwrap());
    assert!(names(store.data()).is_empty());
    // What a killed attempt has left is nobody's session and in nobody's way.
    std::fs::create_dir_all(store.data().join(".new-a/frames")).unwrap();
    std::fs::write(store.data().join(".new-a/frames/view_000.jpg"), b"x").unwrap();
    assert!(store.list().unwrap().is_empty());
    let session = store.create(&manifest(2)).unwrap();
    assert!(names(&session.recording().folder().join("frames")).is_empty());
    assert_eq!(names(store.data()), ["a"]);
    assert!(matches!(store.create(&manifest(2)), Err(SessionError::Exists { .. })));
    let mut senseless = manifest(2);
    (senseless.name, senseless.plan.tolerance_deg) = ("b".into(), f64::NAN);
    assert!(matches!(store.create(&senseless), Err(SessionError::Manifest { .. })));
}

#[test]
fn a_photograph_that_changes_between_the_look_and_the_copy_leaves_no_session() {
    let (dir, store) = store();
    let photos = dir.path().join("photos");
    std::fs::create_dir(&photos).unwrap();
    for n in 0..3 {
        std::fs::write(photos.join(format!("{n}.png")), frame(n).bytes).unwrap();
    }
    let found = scan(&ImportRequest::new(&photos, "*.png")).unwrap();
    std::fs::write(photos.join("2.png"), frame(77).bytes).unwrap();
    let null = serde_json::Value::Null;
    let error = found.import(&store, "a", null.clone(), null).unwrap_err();
    assert!(matches!(error, SessionError::Changed { .. }), "{error}");
    assert!(names(store.data()).is_empty());
}

#[test]
fn a_disk_without_room_is_refused_with_both_figures() {
    let (dir, store) = store();
    let free = free_bytes(store.data()).unwrap();
    assert!(free > 0, "the data folder need not be there yet");
    check_space(dir.path(), 0).unwrap();
    let error = check_space(dir.path(), u64::MAX).unwrap_err().to_string();
    assert!(error.contains(&format!("{} bytes needed", u64::MAX)) && error.contains("bytes free"), "{error}");
    assert_eq!(required_bytes(26, 10), 260 + (64 << 20));
    assert_eq!(required_bytes(usize::MAX, u64::MAX), u64::MAX);
    let session: Session = store.create(&manifest(2)).unwrap();
    assert!(matches!(session.check_space(u64::MAX), Err(SessionError::DiskFull { .. })));
}

#[test]
fn the_state_is_what_the_last_event_that_begins_or_ends_something_says() {
    let (_dir, store) = store();
    let mut session = store.create(&manifest(2)).unwrap();
    assert_eq!(session.recording().state(), State::Created);
    let started = || EventKind::Started { session: "a".into(), views: 2, already_captured: 0 };
    let products =
        || EventKind::Products { files: Vec::new(), timing_s: serde_json::Value::Null, settings: None };
    let steps = [
        (started(), State::Interrupted),
        (EventKind::Failed { error: "x".into() }, State::Failed),
        (started(), State::Interrupted),
        (EventKind::Aborted, State::Aborted),
        (EventKind::Homed, State::Interrupted),
        (EventKind::AcquisitionComplete { views: 2 }, State::Captured),
        (EventKind::Working { stage: "hull".into(), done: 0.5 }, State::Captured),
        (EventKind::Complete { result: serde_json::Value::Null }, State::Complete),
        // New products whose end is not recorded: a run was killed there.
        (products(), State::Captured),
        (EventKind::Complete { result: serde_json::Value::Null }, State::Complete),
    ];
    for (what, state) in steps {
        session.append(what).unwrap();
        assert_eq!(session.recording().state(), state);
        assert_eq!(Recording::read(session.recording().folder()).unwrap().state(), state);
    }
}
