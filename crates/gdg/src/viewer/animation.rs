//! The film of how distance was learned, as an animation.

use super::maze::{FilmedMap, FilmedPixels};
use super::space::{Plane, film_field};
use crate::draw::{
    Animation, Ground, Picture, Raster, Rgb, WALL, blend, contour_interval, distance_colour,
    text_size,
};
use crate::engine::Snapshot;
use crate::env::{ArmScene, MazeScene, Scene};
use crate::job::Job;
use crate::text::grouped;
use crate::train::FilmFrame;

/// Pixels along the longer side of a map, and along a cell's side, at most.
const MAX_MAP_PIXELS: usize = 400;
const MAX_CELL_PIXELS: usize = 24;

/// Pixels along the longer side of a map, at most, if its width is chosen.
const MOST_PIXELS: usize = 8_192;

/// Pixels along the longer side of each of the two planes of an arm.
const PLANE_PIXELS: usize = 280;

/// Radius of agents in pixels, at least and at most, on a map as wide as `MAX_MAP_PIXELS`.
const RADII: [f32; 2] = [1.2, 4.0];

/// Pixels between two contour lines, on average, at least.
const LINE_SPACING: f32 = 30.0;

/// Number of colours between near and far.
const COLOURS: f32 = 64.0;

/// Pixels around a caption.
const MARGIN: usize = 4;

/// How long the shortest interval between two frames is shown, and the last frame, in seconds.
const FRAME_SECONDS: f64 = 0.12;
const LAST_FRAME_SECONDS: f64 = 3.0;

const UNKNOWN: Rgb = (24, 24, 28);
const PAGE: Rgb = (16, 16, 20);
const INK: Rgb = (222, 222, 226);
const AGENT: Rgb = (255, 255, 255);
const EDGE: Rgb = (20, 20, 30);
const GOAL: Rgb = (230, 60, 60);

/// Share of the colour of walls in a pixel that a wall crosses.
const CROSSED_WALL_SHARE: f32 = 0.65;

/// Why there is no animation.
#[derive(Debug, thiserror::Error)]
pub enum FilmError {
    /// Nothing has been filmed.
    #[error("there is no film: nothing has been learned since films are made")]
    NoFrames,
    /// The world is not drawn.
    #[error("films of this world cannot be drawn")]
    NoScene,
    /// The pictures cannot be encoded.
    #[error(transparent)]
    Png(#[from] png::EncodingError),
}

/// Returns the film of a run as an animated PNG file: D by colours with contour lines, the agents,
/// and below them the updates done and the success so far. Colours mean the same in all frames. It
/// is as wide as `width` says, in pixels.
///
/// # Errors
/// There is no film, or it cannot be encoded.
pub fn animate(run: &Snapshot, width: Option<usize>, progress: &Job) -> Result<Vec<u8>, FilmError> {
    progress.begin(0, 1);
    let frames = &run.film;
    let (stage, last) = (Stage::new(run, width)?, frames.last().ok_or(FilmError::NoFrames)?);
    let scale = stage.scale(last);
    let shortest =
        frames.windows(2).map(|pair| pair[1].updates - pair[0].updates).min().unwrap_or(1).max(1);
    let mut file = Vec::new();
    let (columns, rows) = stage.draw(last, scale).size();
    let size = (columns, rows + text_size("", false)[1] + 2 * MARGIN);
    let mut animation = Animation::begin(&mut file, size, frames.len())?;
    for (i, frame) in frames.iter().enumerate() {
        progress.set(i, frames.len());
        let mut picture = Picture::new(size, PAGE);
        picture.put(&stage.draw(frame, scale), [0, 0]);
        write_below(&mut picture, &captions(run, frame), rows);
        let seconds = frames.get(i + 1).map_or(LAST_FRAME_SECONDS, |next| {
            FRAME_SECONDS * (next.updates - frame.updates) as f64 / shortest as f64
        });
        // The first updates may be far from the second frame, as in runs that were filmed only
        // later.
        animation.add(picture, seconds.min(LAST_FRAME_SECONDS))?;
    }
    animation.finish()?;
    Ok(file)
}

/// Returns the last frame of the film of a run as a PNG file, for slides and papers: like
/// [`animate`], and below it what colours and lines mean.
///
/// # Errors
/// There is no film, or it cannot be encoded.
pub fn still(run: &Snapshot, width: Option<usize>) -> Result<Vec<u8>, FilmError> {
    let (stage, last) = (Stage::new(run, width)?, run.film.last().ok_or(FilmError::NoFrames)?);
    let scale = stage.scale(last);
    let drawn = stage.draw(last, scale);
    let (columns, rows) = drawn.size();
    let line = text_size("", false)[1] + MARGIN;
    let mut picture = Picture::new((columns, rows + 2 * line + MARGIN), PAGE);
    picture.put(&drawn, [0, 0]);
    write_below(&mut picture, &captions(run, last), rows);
    let Scale { farthest, interval } = scale;
    let range = format!("D to the goal from 0 (light) to {farthest:.0} steps (dark)");
    let lines = format!("{range}, a line every {interval:.0}");
    write_below(&mut picture, &[lines, range, format!("D: 0 to {farthest:.0}")], rows + line);
    Ok(picture.to_png("gdg-tui")?)
}

/// Writes the first of `texts` that is narrow enough below a picture of `rows` rows.
fn write_below(picture: &mut Picture, texts: &[String], rows: usize) {
    let columns = picture.size().0;
    let fits = |text: &&String| text_size(text, false)[0] + 2 * MARGIN <= columns;
    if let Some(text) = texts.iter().find(fits) {
        picture.text(text, [MARGIN, rows + MARGIN], INK);
    }
}

/// Returns what to write below a frame, the longest text first.
fn captions(run: &Snapshot, frame: &FilmFrame) -> [String; 3] {
    let number = grouped(run.learned(frame.updates));
    let short = format!("update {number}");
    let success =
        run.success_at(frame.updates).map_or(String::new(), |rate| format!(", success {rate:.2}"));
    [format!("{}: {short}{success}", run.title), format!("{short}{success}"), short]
}

/// What colours and lines mean.
#[derive(Clone, Copy)]
struct Scale {
    /// The distance that is darkest.
    farthest: f32,
    /// Steps between two contour lines.
    interval: f32,
}

/// What draws the frames of a run: a map, or two planes through an arm's goal.
struct Stage(Vec<Panel>);

/// A map or a plane.
struct Panel {
    /// Its name, if there are several.
    name: &'static str,
    plane: Plane,
    grounds: Vec<Ground>,
    values: Values,
    /// The radius of agents, in pixels.
    radius: f32,
}

/// Where the values of a frame come from.
enum Values {
    Map(FilmedPixels),
    Arm(ArmScene),
}

impl Stage {
    fn new(run: &Snapshot, width: Option<usize>) -> Result<Self, FilmError> {
        match &run.scene {
            _ if run.film.is_empty() => Err(FilmError::NoFrames),
            Scene::Maze(scene) => Ok(Self(vec![Panel::of_map(scene, width)])),
            Scene::Arm(scene) => Ok(Self(Panel::of_arm(*scene, width).into())),
            Scene::Goals(_) => Err(FilmError::NoScene),
        }
    }

    /// Returns the scale that suits a frame.
    fn scale(&self, frame: &FilmFrame) -> Scale {
        let intervals = self.0.iter().take(1).map(|panel| {
            contour_interval(&panel.open(frame), panel.plane.raster.pixels.0, LINE_SPACING)
        });
        Scale { farthest: frame.farthest(), interval: intervals.fold(1.0, f32::max) }
    }

    /// Draws a frame, with the panels beside each other.
    fn draw(&self, frame: &FilmFrame, scale: Scale) -> Picture {
        let drawn: Vec<Picture> = self.0.iter().map(|panel| panel.draw(frame, scale)).collect();
        let rows = drawn.iter().map(|picture| picture.size().1).max().unwrap_or_default();
        let columns = drawn.iter().map(|picture| picture.size().0 + MARGIN).sum::<usize>() - MARGIN;
        let mut picture = Picture::new((columns, rows), PAGE);
        let mut left = 0;
        for (drawn, panel) in drawn.iter().zip(&self.0) {
            picture.put(drawn, [left, 0]);
            picture.text(panel.name, [left + MARGIN, MARGIN], INK);
            left += drawn.size().0 + MARGIN;
        }
        picture
    }
}

impl Panel {
    fn of_map(MazeScene { map, .. }: &MazeScene, width: Option<usize>) -> Self {
        let raster = match width {
            Some(width) => Raster::of_width(map, width, MOST_PIXELS),
            None => Raster::of_map(map, MAX_MAP_PIXELS, MAX_CELL_PIXELS),
        };
        let columns = raster.pixels.0;
        let size = columns as f32 / raster.window[2];
        let larger = (columns as f32 / MAX_MAP_PIXELS as f32).max(1.0);
        let ground = |i: usize| raster.ground(map, i % columns, i / columns);
        Self {
            name: "",
            plane: Plane { raster, across: vec![1.0, 0.0], up: vec![0.0, -1.0], stretch: 1.0 },
            grounds: (0..raster.len()).map(ground).collect(),
            values: Values::Map(FilmedPixels::new(&FilmedMap::new(map.clone()), raster)),
            radius: (0.35 * size).clamp(RADII[0], RADII[1] * larger),
        }
    }

    /// Returns an arm from the side and from above: where the grip may be.
    fn of_arm(scene: ArmScene, width: Option<usize>) -> [Self; 2] {
        let [low, high] = scene.positions();
        [("side", [0.0, 0.0, 1.0]), ("top", [0.0, 1.0, 0.0])].map(|(name, up): (_, [f32; 3])| {
            let along = |corner: [f32; 3]| corner[1] * up[1] + corner[2] * up[2];
            let size = [high[0] - low[0], along(high) - along(low)];
            // Both are as wide as the same side of the arm's reach.
            let scale = match width {
                Some(width) => (width.saturating_sub(MARGIN) / 2).max(1) as f32 / size[0],
                None => PLANE_PIXELS as f32 / size[0].max(size[1]),
            };
            let pixels = size.map(|metres| (metres * scale).round().max(1.0) as usize);
            let window = [low[0], -along(high), size[0], size[1]];
            let raster = Raster { window, pixels: (pixels[0], pixels[1]) };
            let across = vec![1.0, 0.0, 0.0];
            let plane = Plane { raster, across, up: up.to_vec(), stretch: 1.0 };
            Self { name, plane, grounds: Vec::new(), values: Values::Arm(scene), radius: 3.0 }
        })
    }

    fn field(&self, frame: &FilmFrame) -> Vec<f32> {
        match &self.values {
            Values::Map(pixels) => pixels.field(frame),
            Values::Arm(scene) => film_field(scene, frame, &self.plane),
        }
    }

    /// Returns the values where contour lines may be: not where walls cross pixels, as D differs on
    /// both sides.
    fn open(&self, frame: &FilmFrame) -> Vec<f32> {
        let mut open = self.field(frame);
        for (value, ground) in open.iter_mut().zip(&self.grounds) {
            if !matches!(ground, Ground::Free(_)) {
                *value = f32::NAN;
            }
        }
        open
    }

    fn draw(&self, frame: &FilmFrame, scale: Scale) -> Picture {
        let raster = self.plane.raster;
        let mut picture = Picture::new(raster.pixels, UNKNOWN);
        colour(&mut picture, &self.field(frame), scale.farthest);
        for (pixel, ground) in picture.pixels_mut().iter_mut().zip(&self.grounds) {
            match ground {
                Ground::Free(_) | Ground::Outside => {}
                Ground::Wall => *pixel = WALL,
                Ground::Crossed(_) => *pixel = blend(*pixel, WALL, CROSSED_WALL_SHARE),
            }
        }
        picture.contours(&self.open(frame), scale.interval);
        let size = raster.pixels.0 as f32 / raster.window[2];
        let flat = |at: &[f32]| {
            let [right, down] = self.plane.flat(at);
            [(right - raster.window[0]) * size, (down - raster.window[1]) * size]
        };
        let agents = frame.agents.chunks_exact(self.plane.across.len()).map(flat);
        draw_signs(&mut picture, agents, flat(&self.goal_of(frame)), self.radius);
        picture
    }

    /// Returns where the goal of a frame is shown: of a map, in the middle of its cell.
    fn goal_of(&self, frame: &FilmFrame) -> Vec<f32> {
        match self.values {
            Values::Map(_) => frame.goal.iter().map(|at| at.floor() + 0.5).collect(),
            Values::Arm(_) => frame.goal.clone(),
        }
    }
}

fn colour(picture: &mut Picture, field: &[f32], farthest: f32) {
    for (pixel, value) in
        picture.pixels_mut().iter_mut().zip(field).filter(|(_, value)| value.is_finite())
    {
        // Few colours make files small.
        *pixel = distance_colour(colorous::VIRIDIS, (COLOURS * value / farthest).round() / COLOURS);
    }
}

/// Draws agents and goal, in pixels.
fn draw_signs(
    picture: &mut Picture,
    agents: impl Iterator<Item = [f32; 2]>,
    goal: [f32; 2],
    radius: f32,
) {
    let agents = agents.map(|at| (at, radius, AGENT));
    for (at, radius, rgb) in agents.chain([(goal, 1.5 * radius, GOAL)]) {
        // A file could say anything.
        let (columns, rows) = picture.size();
        if (0.0..=columns as f32).contains(&at[0]) && (0.0..=rows as f32).contains(&at[1]) {
            picture.disc(at, radius + 1.0, EDGE);
            picture.disc(at, radius, rgb);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;
    use std::sync::Arc;

    use super::*;
    use crate::env::{Environment, FetchReach, PointMaze};
    use crate::map::{Grid, parse_map};
    use crate::train::{Film, Method, Preset, Registry, Run, Settings, Trainer};

    /// Returns a run in `world` whose film has frames of these updates.
    fn run(world: &dyn Environment, updates: &[u64]) -> Snapshot {
        let (method, settings) = (Method::default(), Settings::default());
        let run = Run { method, preset: Preset::Default, seed: 1, settings };
        let trainer = Trainer::new(run, world, &Registry::builtin(), 1).expect("a trainer");
        let (world, mut film) = (trainer.world(), Film::default());
        let points = film.points(world).expect("points");
        for updates in updates {
            let distances: Vec<f32> =
                (0..points.place_of.len()).map(|i| (i as u64 * updates) as f32 / 1e3).collect();
            film.add(*updates, 0, world, &points, &distances);
        }
        Snapshot { film: film.frames().clone(), ..Snapshot::capture(&trainer).expect("a snapshot") }
    }

    fn maze(text: &str) -> PointMaze {
        PointMaze::new(Arc::new(parse_map("map", text.as_bytes()).expect("a map")), 0)
    }

    /// Returns the size of a picture or an animation, and how long its frames are shown, in seconds.
    fn shown(file: &[u8]) -> ((u32, u32), Vec<f64>) {
        let mut reader = png::Decoder::new(Cursor::new(file)).read_info().expect("a PNG");
        let count = reader.info().animation_control().map_or(0, |animation| animation.num_frames);
        let mut pixels = vec![0; reader.output_buffer_size().expect("a size")];
        let seconds = (0..count).map(|_| {
            reader.next_frame(&mut pixels).expect("a frame");
            let frame = reader.info().frame_control().expect("a frame");
            f64::from(frame.delay_num) / f64::from(frame.delay_den)
        });
        let seconds = seconds.collect();
        ((reader.info().width, reader.info().height), seconds)
    }

    #[test]
    fn films_of_maps_and_arms_are_animations_in_which_time_passes_evenly() {
        let drawn = Job::default();
        let run_in_maze = run(&maze("....#....\n.........\n"), &[250, 500, 1_000, 1_250]);
        let (size, seconds) = shown(&animate(&run_in_maze, None, &drawn).expect("a film"));
        assert_eq!(size, (9 * 24, 2 * 24 + 24));
        assert_eq!(drawn.share(), Some(0.75), "when the last of four frames began");
        assert_eq!(
            seconds,
            [FRAME_SECONDS, 2.0 * FRAME_SECONDS, FRAME_SECONDS, LAST_FRAME_SECONDS]
        );
        let arm = animate(&run(&FetchReach::new(None, 0), &[1]), None, &drawn).expect("a film");
        assert_eq!(shown(&arm).0, (2 * PLANE_PIXELS as u32 + 4, PLANE_PIXELS as u32 + 24));
    }

    #[test]
    fn the_goal_is_light_and_what_is_far_is_dark() {
        let run = run(&maze("G...........\n"), &[250]);
        let Scene::Maze(scene) = &run.scene else { panic!("a maze") };
        let scale = Scale { farthest: run.film[0].farthest(), interval: 1e6 };
        let picture = Panel::of_map(scene, None).draw(&run.film[0], scale);
        let row = &picture.pixels()[3 * picture.size().0..];
        assert!([60, 150, 270].map(|x| crate::draw::lightness(row[x])).is_sorted_by(|a, b| a > b));
    }

    #[test]
    fn maps_of_every_shape_can_be_filmed_and_pictures_are_as_wide_as_asked_for() {
        for (width, height) in [(1, 1), (700, 1), (1, 700), (300, 200)] {
            let world = PointMaze::new(Arc::new(Grid::empty("shape", width, height)), 0);
            let run = run(&world, &[250]);
            assert!(animate(&run, None, &Job::default()).is_ok(), "{width} x {height}");
            let ((columns, _), _) = shown(&still(&run, Some(500)).expect("a picture"));
            // A map much higher than wide would be far too long otherwise.
            assert_eq!(columns as usize, 500.min((MOST_PIXELS * width / width.max(height)).max(1)));
        }
        let mut run = run(&maze("..\n"), &[250]);
        run.film = Arc::default();
        assert!(matches!(animate(&run, None, &Job::default()), Err(FilmError::NoFrames)));
        assert!(matches!(still(&run, None), Err(FilmError::NoFrames)));
    }
}
