//! What `--help` teaches beside the options: examples, and what to expect.

pub(super) const ALL: &str = "\
Exit codes: 0 done; 1 it failed, what was captured stays; 2 the command line or the configuration is wrong.
Logs go to standard error; GRAINRIG_LOG=info (debug, trace) shows more of them, --log-format json makes objects of them.
GRAINRIG_DATA and GRAINRIG_CONFIG stand for --data and --config; `grainrig config` shows what is set, and what set it. With --json an error is an object, too: {\"error\": {\"kind\": …, \"message\": …}}, where kind is usage,
busy, absent or failed. Linux only.";

pub(super) const SERVE: &str = "\
Examples:
  grainrig serve                              the simulated rig on http://127.0.0.1:7272/
  grainrig serve --listen 127.0.0.1:0         a free port; standard error says which
  grainrig serve --config lab.toml --data /srv/grains

The monitor also compresses the grain of a complete session, beside a capture. A compression that was going on
when the daemon ended goes on when it is started again.

Beyond this computer (0.0.0.0) a token is required: [serve] token in the configuration.";

pub(super) const CAPTURE: &str = "\
Examples:
  grainrig capture quartz-07                  25 views 7.2° apart and one at 180°, as configured by default
  grainrig capture quartz-08 --views 50       50 views 3.6° apart
  grainrig capture ball --config lab.toml --json > ball.json

Ctrl-C finishes the view in hand; a second one stops at once. Either way, and after a power failure,
`grainrig resume NAME` goes on. The session is the folder NAME in the data folder: frames/ has the
camera's own files, products/ has grain.inp (Abaqus), grain.vtu (ParaView), grain.stl, result.json
(figures; lengths in mm), each view's outline over its photograph and a calibration sheet.";

pub(super) const RESUME: &str = "\
Examples:
  grainrig resume quartz-07                   a session of the data folder (--data)
  grainrig resume /srv/grains/quartz-07       a session's folder

Views that are there are never taken again. Where only the computation is missing or has failed, the
rig is not needed. A complete session is left as it is.";

pub(super) const REPLAY: &str = "\
Examples:
  grainrig replay quartz-07
  grainrig replay quartz-07 --json            the result, with the products that differ under \"differs\"

The recorded products stay as they are; one that was lost or damaged on the disk is written again.
Exit code 1 where a product comes out with other bytes than the recorded ones.";

pub(super) const IMPORT: &str = "\
Examples:
  before a turntable, 7.2° a step, telecentric, 4.37 µm a pixel, with one more picture at 180°:
    grainrig import photos --pattern 'grain_*.png' --mm-per-px 0.00437 --closing-view 25
  clockwise in steps of 10°, through a lens 250 mm away:
    grainrig import photos --step-deg 10 --rotation cw --mm-per-px 0.02 --camera-distance-mm 250
  with a camera matrix for each picture:
    grainrig import dino --pattern 'dino*.png' --cameras dinoSR_par.txt
  with the scale measured from a ball (see `grainrig calibrate scale --help`):
    grainrig import photos --calibration scale.json

Pictures are taken in the order of the numbers in their names, at least 2 of one size. They are copied,
byte for byte; nothing is left of the session where one of them cannot be used.";

pub(super) const CALIBRATE_SCALE: &str = "\
Examples:
  five pictures of a 2 mm ball, the table turned by 36° between them, the lens 120 mm away:
    grainrig calibrate scale balls --pattern 'ball_*.png' --ball-diameter-mm 2 --ball-tolerance-mm 0.001
        --background empty.png --step-deg 36 --camera-distance-mm 120 --out scale.json
  then:
    grainrig import photos --calibration scale.json
    grainrig capture quartz-07 --calibration scale.json

Set the ball where the grain will stand, in focus, whole in the picture and several hundred pixels wide; leave
camera, focus and light as they are for the grain. One picture is enough; more, with the table turned between
them, show the scatter and, with their angles, how far the ball stands before or behind the axis: without them
that is part of the stated uncertainty. The file states what the uncertainty is made of, each part as one
standard deviation over the value.";

pub(super) const STUDY_SENSITIVITY: &str = "\
Examples:
  grainrig study sensitivity                                  balls of 0.5 and 1 mm, 5 µm pixels, 2 to 30 views
  grainrig study sensitivity --stl grain.stl --views 6,25,72  what more views would give a grain like this one

V_R/V_M is the real volume over the model's, as Nadimi and Fonseca (2017) state it: about 0.95 at 4 views, near 1 from
20 to 25. The model is voxels as large as a pixel, counted as they do; the exact hull of exact silhouettes, which
shows what the views alone do; and a coarse and a fine mesh of the hull. For a ball the exact one is
(pi/2N)/tan(pi/2N). Written are sensitivity.csv, and as SVG and PNG
the silhouettes, the shapes from 2, 6 and 30 views and the curves.";

pub(super) const RECONSTRUCT: &str = "\
Examples:
  grainrig reconstruct quartz-07                          as the session was configured
  grainrig reconstruct quartz-07 --surface-size-mm 0.02   a finer surface; the other controls stay

By default the mesh has about 50 000 tetrahedra, whatever the grain's size. `replay` repeats the newest
mesh.";

pub(super) const MESH: &str = "\
Examples:
  grainrig mesh grain.stl                                 writes grain.inp here
  grainrig mesh grain.stl --out grain.vtu fine.inp --surface-size-mm 0.02 --facet-angle-deg 20
  grainrig mesh grain.ply --size-at-contact-mm 0.008      finer where plates will touch it
  grainrig mesh grain.stl --order 2 --out grain.msh       ten-node tetrahedra for Gmsh
  grainrig mesh quartz-07 --out quartz-07.inp             computes the session's mesh and copies it here

A surface must be closed and is taken as mm. By default the mesh has about 50 000 tetrahedra. Sizes, angles and
distances are promises: where one can't be kept there is no mesh, and the error says which and by how much.";

pub(super) const MERGE: &str = "\
Examples:
  grainrig capture quartz-07-a                    then lay the grain on another side, best one that was at a side
  grainrig capture quartz-07-b
  grainrig merge quartz-07-a quartz-07-b --out quartz-07
  grainrig merge quartz-07-a quartz-07-b --out fine --surface-size-mm 0.02 --json

How the grain was turned need not be known: it is found from the silhouettes, which both hulls together must
fill. NAME becomes a session of the data folder like others: verify, replay and compress it. Its products are grain.inp,
grain.vtu, grain.stl and result.json, whose \"merge\" has the motion, how well the silhouettes are filled, and the volumes
of both hulls and of the merged one. The two captures are only read; a replay needs them where they were.
Exit code 1, and nothing written, where the poses do not fit (another grain, a wrong scale or sense of rotation)
or fit in several ways (a ball, a symmetric grain).";

pub(super) const COMPRESS: &str = "\
Examples:
  grainrig compress quartz-07                             a session's grain to 10 N, elastic, E = 100 GPa
  grainrig compress grain.stl --material plastic --yield-mpa 100 --out plastic --beside grain-compressed
  grainrig compress --sphere-diameter-mm 0.815 --to-approach-mm 0.06 --friction 0
  grainrig compress quartz-07 --experiment test.csv --compliance-um-per-n 0.12
  grainrig compress --resume data/quartz-07/compressions/elastic
  grainrig compress quartz-07 --ensemble 1000             δ_i as an interval: the grain in all its rests, laid askew by 2°
  grainrig compress quartz-07 --ensemble 1000 --rest 2 --placing-deg 1 --young-span-mpa 90000 110000

The grain lies in the rest that it comes to from how it was photographed (`grainrig rests` shows all; --rest); the plates turn it
until they hold it, and it deforms from there. The approach counts from where they first touch it (for a sphere from its
diameter). The results of a session's grain lie in its folder, below compressions/, where the monitor lists
them; those of a file in NAME-compressed, or in --out. There are curve.csv, curve.svg and .png, result.json, the deformed mesh with its stresses at
eight stages (stages.pvd for ParaView) and a picture of a cut at each, and the same model as decks for Abaqus/Explicit
and CalculiX. Ctrl-C writes what there is; after that, or a power failure, the same command again (or --resume DIR)
goes on with the same bits; at most 20 s of computing are lost.

One pose is one draw of many: --ensemble N tells how far δ_i spreads. The plates' turning of the grain is followed in N ways, what then
deforms is computed in --cases of them (an hour of one core for 24; they go a core each) and foretold for the others by how far the plates
sink into their shapes. The folder NAME-ensemble, or --out, gets ensemble.png and .svg, draws.csv, cases.csv and result.json. The
same command again goes on with the cases that are missing.
Units: mm, N, MPa, t.";

pub(super) const RESTS: &str = "\
Examples:
  grainrig rests quartz-07                                a session's grain, between plates of friction 0.2
  grainrig rests grain.stl --unit um --friction 0 --json
  grainrig rests quartz-07 --ensemble 1000                and laid askew by 2°, at frictions up to 0.2: an interval
  grainrig compress quartz-07 --rest 2                    press it as it lies in the second of them

A rest is a way to lie on a level plate that it takes some lift of the grain's centre to leave (--least-lift-mm; else a surface
of facets would rest on each of them). Its chance is that of being let down at random. Its gap angle is that between the plates' normal and the shortest line
from what touches below to what touches above: where its tangent is above the friction, closing plates turn the grain, nearly
without a force, until it is not (or the upper contacts stand above the lower ones, where there is no friction). How far
they come meanwhile is in the column rocking: what a compression shows before it shows anything elastic.
Written are rests.csv and rests.png: the grain in each of its rests, seen from the side.";

pub(super) const VERIFY: &str = "\
Examples:
  grainrig verify quartz-07
  grainrig verify /srv/grains/quartz-07 --json

Reads everything, changes nothing. Each file that is missing, changed or unknown is named with what to
do; exit code 1 where there is one.";

pub(super) const RM: &str = "\
Examples:
  grainrig rm test-1 test-2                   asks first
  grainrig rm --yes test-1                    for scripts

Not while somebody writes the session, and not while a merged grain of the data folder is made from it.";

pub(super) const FOCUS: &str = "\
Examples:
  grainrig focus --config rig.toml                        a line a picture, until Ctrl-C
  grainrig focus --config rig.toml --save focus.jpg       and the newest picture in a file, for a viewer
  grainrig focus --config rig.toml --pictures 1 --json

Turn the lens until the sharpness is greatest. Where a grain is found, the blur of its outline (the standard deviation,
pixels of the picture shown) says how good that is. No picture is kept on the camera, and the stage does not move.";

pub(super) const CONFIG: &str = "\
Examples:
  grainrig config                                         every key, its value and what set it
  grainrig config --config lab.toml --json
  grainrig config --default > ~/.config/grainrig/config.toml
  grainrig config --schema > grainrig.schema.json         for an editor: begin the file with #:schema ./grainrig.schema.json

What is shown is a configuration itself. A named file (--config, GRAINRIG_CONFIG) is used alone, and must be there.";

pub(super) const COMPLETIONS: &str = "\
Examples:
  grainrig completions bash > ~/.local/share/bash-completion/completions/grainrig
  grainrig completions zsh > ~/.zfunc/_grainrig           a folder of $fpath
  grainrig completions fish > ~/.config/fish/completions/grainrig.fish";

pub(super) const MAN: &str = "\
Examples:
  grainrig man | man -l -
  grainrig man --out /usr/local/share/man/man1";
