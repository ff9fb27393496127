//! Groups runs to charts and curves, and averages over seeds.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use miette::{Report, miette};

use super::{By, Drawable, Measure, PlotOptions, csv_of};
use crate::experiment::saved_runs::{CIRCUMSTANCES, SavedRun, differing};
use crate::experiment::spec::told_apart;
use crate::figure::{Chart, Curve, Point, colour, round_top};
use gdg::draw::Rgb;
use gdg::text::sanitized;

/// Means that end before this share of the longest seed are pointed out.
const SHORT: f64 = 0.9;

/// Which runs share a curve, and which curves a chart.
pub struct Grouping {
    by: Vec<By>,
    /// What each run differs in from the others: method, map and settings.
    pub parts: Vec<[String; 3]>,
    differ: [bool; 3],
}

const PARTS: [By; 3] = [By::Method, By::Map, By::Setting];

impl Grouping {
    /// Groups runs by what they differ in: curves by `by`, or else by method and settings, and by
    /// map if they differ in neither.
    pub fn new(runs: &[SavedRun], by: &[By]) -> Self {
        // Worlds without a map have settings of their own.
        fn kind(run: &SavedRun) -> (&str, &str) {
            (&run.method, if run.fingerprint.is_some() || run.is_edited() { "" } else { &run.map })
        }
        let mut alike: BTreeMap<_, Vec<&SavedRun>> = BTreeMap::new();
        runs.iter().for_each(|run| alike.entry(kind(run)).or_default().push(run));
        let common = alike.iter().map(|(kind, runs)| {
            let sets = runs.iter().map(|run| run.settings.iter().collect::<BTreeSet<_>>());
            (*kind, sets.reduce(|a, b| &a & &b).unwrap_or_default())
        });
        let common: BTreeMap<_, BTreeSet<&String>> = common.collect();
        // Unknown settings do not distinguish runs, nor do edits of different maps.
        let among =
            |i: usize, run: &SavedRun| (i, run.method.clone(), (i == 0).then(|| run.map.clone()));
        let mut told: BTreeMap<_, BTreeSet<String>> = BTreeMap::new();
        for run in runs {
            for (i, own) in run.circumstances().into_iter().enumerate() {
                told.entry(among(i, run)).or_default().extend(own);
            }
        }
        let told = |run: &SavedRun| {
            let own = run.circumstances().into_iter().enumerate().filter_map(|(i, own)| {
                let (own, all) = (own?, &told[&among(i, run)]);
                let text = if i == 0 { briefly(&own, all) } else { own };
                (all.len() > 1 && !text.is_empty()).then(|| format!("{}={text}", CIRCUMSTANCES[i]))
            });
            own.collect::<Vec<_>>()
        };
        // The values of a sweep are all named, also that of the preset.
        let mut swept: BTreeMap<_, Vec<&SavedRun>> = BTreeMap::new();
        runs.iter().for_each(|run| swept.entry((kind(run), &run.variant)).or_default().push(run));
        let swept = swept.into_iter().map(|(kind, runs)| (kind, differing(&runs)));
        let swept: BTreeMap<_, _> = swept.collect();
        let setting = |run: &SavedRun| {
            let is_own = |set: &&String| !common[&kind(run)].contains(set);
            let of_preset = |name: &&str| match run.own_setting(name) {
                None => Some(format!("{name}={}", run.setting(name)?)),
                Some(_) => None,
            };
            let swept = swept[&(kind(run), &run.variant)].iter().filter_map(of_preset);
            let own = run.settings.iter().filter(is_own).cloned().chain(swept);
            let own = own.collect::<BTreeSet<_>>().into_iter().collect::<Vec<_>>().join(" ");
            // Variants of several experiments may have the same name.
            let mut others = alike[&kind(run)].iter();
            let is_known =
                others.all(|other| other.variant != run.variant || other.settings == run.settings);
            let own = match &run.variant {
                Some(name) if is_known => name.clone(),
                Some(name) => format!("{name}: {own}"),
                None => own,
            };
            let all = [own].into_iter().chain(told(run)).filter(|text| !text.is_empty());
            all.collect::<Vec<_>>().join(" ")
        };
        let worlds = runs.iter().map(|run| (&*run.map, run.fingerprint.as_deref()));
        let maps = told_apart(&worlds.collect::<Vec<_>>());
        let parts: Vec<[String; 3]> = runs
            .iter()
            .zip(maps)
            // They come from files, and go to the figure and its table.
            .map(|(run, map)| [run.method.clone(), map, setting(run)].map(|part| sanitized(&part)))
            .collect();
        let differ = [0, 1, 2].map(|i| parts.iter().any(|part| part[i] != parts[0][i]));
        let by = match (by, differ) {
            ([], [false, true, false]) => vec![By::Map],
            ([], _) => vec![By::Method, By::Setting],
            (by, _) => by.to_vec(),
        };
        Self { by, parts, differ }
    }

    fn names(&self, run: usize) -> (String, String) {
        let named = |on_curve: bool| {
            let parts = PARTS.iter().enumerate().filter(|(i, part)| {
                self.by.contains(part) == on_curve
                    && (self.differ[*i] || on_curve && self.by.len() == 1)
            });
            let names = parts.map(|(i, part)| match &self.parts[run][i] {
                name if !name.is_empty() => name.as_str(),
                _ if *part == By::Setting && (self.by.len() == 1 || !on_curve) => "default",
                _ => "",
            });
            names.filter(|name| !name.is_empty()).collect::<Vec<_>>().join(", ")
        };
        let (chart, curve) = (named(false), named(true));
        (chart, if curve.is_empty() { self.parts[run][0].clone() } else { curve })
    }
}

/// Returns the updates of edits alone, if these tell them apart from all others.
fn briefly(edits: &str, all: &BTreeSet<String>) -> String {
    let updates = |edits: &str| {
        let each = edits.split(',').filter_map(|edit| edit.split(':').next());
        each.collect::<Vec<_>>().join(",")
    };
    let own = updates(edits);
    let alike = all.iter().filter(|other| updates(other) == own).count();
    if alike == 1 { own } else { edits.to_owned() }
}

pub type Points = Vec<(f64, f64)>;

/// A curve: the points of each seed.
pub struct SeedCurves {
    pub chart: String,
    pub name: String,
    pub colour: Rgb,
    pub marker: usize,
    pub seeds: BTreeMap<u64, Points>,
}

impl SeedCurves {
    pub fn curve(&self, x: [f64; 2]) -> Curve {
        let points = mean(&self.seeds, x);
        Curve { name: self.name.clone(), colour: self.colour, marker: self.marker, points }
    }
}

/// Returns the charts of lines, in the order in which they first appear; their axis is labelled `y`.
pub fn charts(lines: &[SeedCurves], options: &PlotOptions, y: &str, x: [f64; 2]) -> Vec<Chart> {
    let mut charts: Vec<Chart> = Vec::new();
    for line in lines {
        let curve = line.curve(x);
        match charts.iter_mut().find(|chart| chart.title == line.chart) {
            Some(chart) => chart.curves.push(curve),
            None => charts.push(Chart {
                title: line.chart.clone(),
                labels: [options.x.label(), y].map(str::to_owned),
                x,
                top: 1.0,
                curves: vec![curve],
            }),
        }
    }
    if options.y == Measure::Error {
        let points = charts.iter().flat_map(|chart| &chart.curves).flat_map(|curve| &curve.points);
        let top = round_top(points.map(|point| point.high));
        charts.iter_mut().for_each(|chart| chart.top = top);
    }
    charts
}

/// Returns the lines of runs, in the order in which they first appear, and the label of what they show. The
/// label says whether success is planned, or if runs differ in that, their names.
pub fn lines(
    runs: &[SavedRun],
    grouping: &Grouping,
    options: &PlotOptions,
    notes: &mut Vec<String>,
) -> Result<(Vec<SeedCurves>, String), Report> {
    let (mut lines, mut names) = (Vec::<SeedCurves>::new(), Vec::<String>::new());
    let kind_of = |run: &SavedRun| if run.plans() { ", planned" } else { ", alone" };
    let of_success = runs.iter().filter(|_| options.y == Measure::Success);
    let kinds: BTreeSet<&str> = of_success.map(kind_of).collect();
    for (i, run) in of_seeds(runs, grouping, notes) {
        let (chart, name) = grouping.names(i);
        let name = if kinds.len() > 1 { name + kind_of(run) } else { name };
        let points = run.evaluations.iter();
        let points: Points = points
            .filter_map(|at| Some((options.x.of(at), options.y.of(&at.evaluation)?)))
            .collect();
        if points.is_empty() {
            let (y, source) = (options.y.label(), run.source.display());
            notes.push(format!("{source}: {} has no {y}: left out", run.method));
            continue;
        }
        let known = lines.iter_mut().find(|line| line.chart == chart && line.name == name);
        if let Some(line) = known {
            line.seeds.insert(run.seed, points);
            continue;
        }
        let marker = names.iter().position(|known| *known == name).unwrap_or_else(|| {
            names.push(name.clone());
            names.len() - 1
        });
        let seeds = BTreeMap::from([(run.seed, points)]);
        lines.push(SeedCurves { chart, name, colour: colour(marker), marker, seeds });
    }
    if lines.is_empty() {
        let help = "--y success, alone, error or explored";
        let (y, methods) = (options.y.label(), runs.iter().map(|run| run.method.as_str()));
        let methods: BTreeSet<&str> = methods.collect();
        let methods = methods.into_iter().collect::<Vec<_>>().join(", ");
        return Err(miette!(help = help, "not known of these runs ({methods}): {y}"));
    }
    if let [only] = &mut lines[..] {
        only.colour = colour(options.y.colour(runs[0].plans()));
    }
    for line in &lines {
        let ends = line.seeds.iter().filter_map(|(seed, points)| Some((points.last()?.0, seed)));
        let longest = ends.clone().map(|(end, _)| end).fold(0.0, f64::max);
        let shortest = ends.min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((end, seed)) = shortest.filter(|(end, _)| *end < SHORT * longest) {
            let (name, chart, x) = (&line.name, &line.chart, options.x.label());
            let name = if chart.is_empty() { name.clone() } else { format!("{name} ({chart})") };
            notes.push(format!(
                "{name}: the mean ends after {end:.0} of {longest:.0} {x}, as seed {seed} does"
            ));
        }
    }
    let kind = kinds.first().filter(|_| kinds.len() == 1).unwrap_or(&"");
    Ok((lines, options.y.label().to_owned() + kind))
}

/// Returns a run for each seed of each curve, with its index: of several, the longest counts.
fn of_seeds<'a>(
    runs: &'a [SavedRun],
    grouping: &Grouping,
    notes: &mut Vec<String>,
) -> Vec<(usize, &'a SavedRun)> {
    let mut seeds: BTreeMap<_, Vec<usize>> = BTreeMap::new();
    for (i, run) in runs.iter().enumerate() {
        seeds.entry((grouping.names(i), run.seed)).or_default().push(i);
    }
    let (mut all, mut left_out) = (Vec::new(), Vec::new());
    for mut found in seeds.into_values() {
        found.sort_by_key(|i| (runs[*i].begun, Reverse(runs[*i].updates)));
        let mut found = found.into_iter().map(|i| (i, &runs[i]));
        all.extend(found.next());
        left_out.extend(found.map(|(_, run)| run.source.display().to_string()));
    }
    all.sort_by_key(|(i, _)| *i);
    if !left_out.is_empty() {
        let names = left_out.join(", ");
        notes.push(format!(
            "left out, as another run has the same method, map, settings and seed: {names}"
        ));
    }
    all
}

/// Averages over seeds wherever all of them have points on both sides, up to the end of the range.
fn mean(seeds: &BTreeMap<u64, Points>, [_, end]: [f64; 2]) -> Vec<Point> {
    let ends = |of: fn(&Points) -> Option<&(f64, f64)>| {
        seeds.values().filter_map(of).map(|point| point.0).collect::<Vec<_>>()
    };
    let from = ends(|points| points.first()).into_iter().fold(0.0, f64::max);
    let to = ends(|points| points.last()).into_iter().fold(end, f64::min);
    let mut places: Vec<f64> = seeds.values().flatten().map(|point| point.0).collect();
    places.push(to);
    places.retain(|x| (from..=to).contains(x));
    places.sort_by(f64::total_cmp);
    places.dedup();
    let at = |x: f64| {
        let values: Vec<f64> =
            seeds.values().filter_map(|points| interpolated(points, x)).collect();
        let (low, high) = values
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        Point { x, mean: values.iter().sum::<f64>() / values.len() as f64, low, high }
    };
    places.into_iter().map(at).collect()
}

fn interpolated(points: &Points, x: f64) -> Option<f64> {
    // Of several at one place, the last: what the run had come to.
    if let Some((_, value)) = points.iter().rfind(|point| point.0 == x) {
        return Some(*value);
    }
    let pair = points.windows(2).find(|pair| pair[0].0 < x && x < pair[1].0)?;
    let [(from, left), (to, right)] = [pair[0], pair[1]];
    Some(left + (right - left) * (x - from) / (to - from))
}

/// Returns the table behind charts, whose axes have these names: every seed's values, and the means.
pub fn table<'a>(
    lines: impl IntoIterator<Item = &'a SeedCurves>,
    axes: [&str; 2],
    x: [f64; 2],
) -> Result<Vec<u8>, Report> {
    let mut table = Vec::new();
    for line in lines {
        let mut row = |seed: String, x: f64, y: f64, band: [String; 2]| {
            let texts = [line.chart.clone(), line.name.clone(), seed, x.to_string(), y.to_string()];
            table.push(texts.into_iter().chain(band).collect::<Vec<String>>());
        };
        for (seed, points) in &line.seeds {
            points.iter().for_each(|(x, y)| row(seed.to_string(), *x, *y, Default::default()));
        }
        for Point { x, mean, low, high } in mean(&line.seeds, x) {
            row("mean".to_owned(), x, mean, [low.to_string(), high.to_string()]);
        }
    }
    csv_of(&["chart", "curve", "seed", axes[0], axes[1], "low", "high"], table)
}
