//! A part of a recording as an animated PNG.

use std::path::Path;

use miette::{IntoDiagnostic, Report, WrapErr};
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::{buffer_of, check_within, duration, play};
use crate::cli::FramesArgs;
use crate::host::outputs::{refuse_existing, refuse_input};
use crate::host::waiting::Working;
use crate::tui::{PageColours, picture_of};
use gdg::draw::Animation;
use gdg::files::write_atomically;

/// How long the last frame is shown, in seconds.
const LAST_FRAME_SECONDS: f64 = 2.0;

/// Stages of drawing: the recording is read, frames are counted, and drawn.
const STAGES: usize = 3;

/// The most frames of an animation: half an hour at 10 frames per second.
const MAX_FRAMES: usize = 18_000;

/// Writes the animation that `args` ask for into `out`; returns its path as a line.
///
/// # Errors
/// Fails if a file cannot be read or written, if the recording is invalid (naming the line) or
/// shorter than the part asked for, or if `out` exists already.
pub fn write(args: &FramesArgs, out: &Path) -> Result<String, Report> {
    let drawing = Working::begin("the animation to be drawn");
    let progress = drawing.progress();
    progress.begin(0, STAGES);
    let seconds = duration(&args.cast, progress)?;
    let to = args.to.unwrap_or(seconds);
    check_within(&args.cast.to_string_lossy(), [args.from, to].iter(), seconds)?;
    if args.from >= to {
        return Err(miette::miette!(
            help = "give --from below --to",
            "the animation would be empty"
        ));
    }
    refuse_existing(out, args.overwrite)?;
    refuse_input("--animate", out, std::iter::once(args.cast.as_path()))?;
    let step = args.speed / f64::from(args.fps);
    let count = ((to - args.from) / step).ceil() as usize;
    if count > MAX_FRAMES {
        let help = "give --from and --to, fewer --fps, or a higher --speed";
        return Err(miette::miette!(
            help = help,
            "the animation would have {count} frames, more than {MAX_FRAMES}"
        ));
    }
    let mut moments: Vec<f64> = (0..count).map(|i| args.from + step * i as f64).collect();
    moments.push(to);
    // The file begins with the number and size of its frames, which a first pass determines.
    let mut plan = Plan::default();
    progress.begin(1, STAGES);
    play(&args.cast, moments.clone(), progress, |screen, at| {
        plan.add(buffer_of(screen), (at - args.from) / args.speed);
        Ok(())
    })?;
    let bytes = plan.encode(|plan, animation| {
        let mut at = 0;
        progress.begin(2, STAGES);
        play(&args.cast, moments, progress, |screen, _| {
            plan.draw(at, &buffer_of(screen), animation)?;
            at += 1;
            Ok(())
        })
    })?;
    write_atomically(out, &bytes)
        .into_diagnostic()
        .wrap_err_with(|| format!("{}: cannot be written", out.display()))?;
    Ok(format!("{}\n", out.display()))
}

/// The frames of an animation: the moments at which the screen changes.
#[derive(Default)]
struct Plan {
    /// Columns and rows of the largest screen.
    size: (u16, u16),
    latest: Option<Buffer>,
    /// For each moment, whether it is a frame, and its time in seconds.
    moments: Vec<(bool, f64)>,
}

impl Plan {
    fn add(&mut self, screen: Buffer, seconds: f64) {
        self.size = (self.size.0.max(screen.area.width), self.size.1.max(screen.area.height));
        self.moments.push((self.latest.as_ref() != Some(&screen), seconds));
        self.latest = Some(screen);
    }

    /// Encodes the animation, whose frames `draw_all` draws.
    fn encode(
        self,
        draw_all: impl FnOnce(&Self, &mut Animation) -> Result<(), Report>,
    ) -> Result<Vec<u8>, Report> {
        let empty = Buffer::empty(Rect::new(0, 0, self.size.0, self.size.1));
        let size = picture_of(&empty, empty.area, PageColours::default()).size();
        let frames = self.moments.iter().filter(|(changed, _)| *changed).count();
        let mut bytes = Vec::new();
        let mut animation = Animation::begin(&mut bytes, size, frames).into_diagnostic()?;
        draw_all(&self, &mut animation)?;
        animation.finish().into_diagnostic()?;
        Ok(bytes)
    }

    /// Draws moment `at`, unless nothing has changed.
    fn draw(&self, at: usize, screen: &Buffer, animation: &mut Animation) -> Result<(), Report> {
        let (true, seconds) = self.moments[at] else { return Ok(()) };
        let next = self.moments[at + 1..]
            .iter()
            .find(|(changed, _)| *changed)
            .map(|(_, seconds)| *seconds);
        let last = self.moments.last().map_or(0.0, |(_, seconds)| *seconds) + LAST_FRAME_SECONDS;
        // Smaller screens are drawn into the corner of the largest.
        let mut whole = Buffer::empty(Rect::new(0, 0, self.size.0, self.size.1));
        whole.merge(screen);
        let picture = picture_of(&whole, whole.area, PageColours::default());
        animation.add(picture, next.unwrap_or(last) - seconds).into_diagnostic()
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::BufReader;
    use std::path::PathBuf;

    use super::*;
    use crate::commands::frames::tests::{HEADER, recording};

    /// Creates a recording of three screens, the second of them shown for two seconds, and
    /// arguments that animate it.
    fn three_screens() -> (tempfile::TempDir, FramesArgs, PathBuf) {
        let events = [
            HEADER,
            r#"[0.0,"o","ab"]"#,
            r#"[1.0,"o","\u001b[1;2Hx"]"#,
            r#"[3.0,"o","\u001b[1;4Hy"]"#,
        ];
        let (folder, mut args) = recording(&events.join("\n"), &[]);
        let out = folder.path().join("film.png");
        args.animate = Some(out.clone());
        (folder, args, out)
    }

    /// Reads an animation: of each frame, left, top, width, height and how long it is shown, in
    /// seconds.
    fn frames(path: &Path) -> Vec<([u32; 4], f64)> {
        let mut reader = png::Decoder::new(BufReader::new(File::open(path).expect("a file")))
            .read_info()
            .expect("PNG");
        let count = reader.info().animation_control().expect("an animation").num_frames;
        let mut pixels = vec![0; reader.output_buffer_size().expect("a size")];
        (0..count)
            .map(|_| {
                reader.next_frame(&mut pixels).expect("a frame");
                let frame = *reader.info().frame_control().expect("a frame");
                let seconds = f64::from(frame.delay_num) / f64::from(frame.delay_den);
                ([frame.x_offset, frame.y_offset, frame.width, frame.height], seconds)
            })
            .collect()
    }

    #[test]
    fn frames_hold_what_changes_and_for_how_long_it_stays() {
        let (_folder, args, out) = three_screens();
        assert_eq!(write(&args, &out).expect("written").trim(), out.to_string_lossy());
        let frames = frames(&out);
        assert_eq!(
            frames.iter().map(|(_, seconds)| *seconds).collect::<Vec<_>>(),
            [1.0, 2.0, LAST_FRAME_SECONDS]
        );
        let areas: Vec<[u32; 4]> = frames.iter().map(|(area, _)| *area).collect();
        assert_eq!(areas[0], [0, 0, 32, 16]);
        // The second character, 8 pixels wide, and the fourth.
        assert!(areas[1][0] >= 8 && areas[1][0] + areas[1][2] <= 16, "{areas:?}");
        assert!(areas[2][0] >= 24 && areas[2][0] + areas[2][2] <= 32, "{areas:?}");
    }

    #[test]
    fn small_frames_after_large_ones_and_changes_of_size_are_drawn() {
        let far = [
            HEADER,
            r#"[0,"o","ab"]"#,
            r#"[1,"r","9x3"]"#,
            r#"[2,"o","\u001b[3;9Hz"]"#,
            r#"[3,"r","4x1"]"#,
        ];
        let (folder, mut args) = recording(&far.join("\n"), &[]);
        let out = folder.path().join("film.png");
        args.animate = Some(out.clone());
        write(&args, &out).expect("written");
        let last = frames(&out).last().map(|(area, _)| *area).expect("frames");
        assert!(last[0] + last[2] <= 72 && last[1] + last[3] <= 48, "{last:?}");
        std::fs::write(&args.cast, format!("{HEADER}\n[0,\"o\",\"x\"]\n[1e18,\"o\",\"y\"]\n"))
            .expect("a file");
        args.overwrite = true;
        assert!(
            write(&args, &out).expect_err("too long").to_string().contains("frames, more than")
        );
    }

    #[test]
    fn a_part_is_played_faster() {
        let (_folder, mut args, out) = three_screens();
        (args.from, args.to, args.speed) = (0.5, Some(3.0), 2.0);
        write(&args, &out).expect("written");
        assert_eq!(
            frames(&out).iter().map(|(_, s)| *s).collect::<Vec<_>>(),
            [0.4, 0.85, LAST_FRAME_SECONDS]
        );
    }

    #[test]
    fn parts_outside_the_recording_and_existing_files_are_refused() {
        let (_folder, mut args, out) = three_screens();
        args.to = Some(9.0);
        assert!(write(&args, &out).expect_err("too long").to_string().contains("3 s long"));
        args.overwrite = true;
        args.to = None;
        let cast = args.cast.clone();
        assert!(
            write(&args, &cast).expect_err("its input").to_string().contains("is read by this run")
        );
        (args.overwrite, args.from, args.to) = (false, 2.0, Some(2.0));
        assert!(write(&args, &out).expect_err("empty").to_string().contains("empty"));
        assert!(!out.exists());
        (args.from, args.to) = (0.0, None);
        std::fs::write(&out, b"mine").expect("a file");
        assert!(write(&args, &out).is_err());
        assert_eq!(std::fs::read(&out).expect("kept"), b"mine");
    }
}
