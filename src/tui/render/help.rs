//! The help: every action, the numbers, and the legend of the map.

use std::ops::Range;

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Clear, Paragraph};

use super::side::training;
use super::{middle, without_slivers};
use crate::tui::action::{Action, Binding, Mode, SECTIONS, bindings};
use crate::tui::dialog::Help;
use crate::tui::keymap::Keymap;
use crate::tui::layout::{Click, ClickableLine, ScreenLayout};
use crate::tui::pane_text::wrapped;
use crate::tui::scene::{Scene, WALK_MEANINGS};
use crate::tui::screen::Screen;
use crate::tui::theme::{BOLD, ColourDepth, DIM, REVERSED};

/// Columns of the help, if there is room.
const HELP_WIDTH: u16 = 78;

/// Columns of keys and names, where the help is wide and where it is not.
const NAME_WIDTH: usize = 15;
const NARROW_NAME_WIDTH: usize = 8;

/// Columns from which the help is wide.
const WIDE: usize = 60;

/// The modes of a run whose bindings are listed.
const OF_RUNS: [Mode; 3] = [Mode::Watching, Mode::Editing, Mode::Touring];

/// Those of a comparison.
const OF_COMPARISONS: [Mode; 2] = [Mode::Comparing, Mode::EditingBoth];

/// Draws the help in the middle of the screen, scrolled at most to the end of the text.
pub fn draw(
    frame: &mut Frame,
    screen: &Screen,
    scene: &Scene,
    help: &Help,
    layout: &mut ScreenLayout,
) {
    let width = without_slivers(frame.area(), HELP_WIDTH);
    let entries = entries(screen, scene, usize::from(width.saturating_sub(2)), help);
    draw_entries(frame, &entries, help, layout);
}

/// Draws the help of lists of runs, like [`draw`].
pub fn draw_for_lists(frame: &mut Frame, keymap: &Keymap, help: &Help, layout: &mut ScreenLayout) {
    let width = usize::from(without_slivers(frame.area(), HELP_WIDTH).saturating_sub(2));
    let entry = |binding: &Binding| {
        let wording = match binding.action {
            Action::Move(_, 1) => "select the next run",
            Action::Move(..) => "select the run before",
            Action::Close => "close the help, show all runs again, or unmark them",
            _ => binding.long,
        };
        entry(&keymap.display_keys(binding).join(" "), wording, width)
    };
    let listed = |when| {
        let is_listed = move |b: &&Binding| b.is_active(Mode::Listing) && b.when == when;
        bindings().filter(is_listed).map(entry)
    };
    let entries: Vec<_> = listed(Some(Mode::Listing)).chain(listed(None)).collect();
    draw_entries(frame, &entries, help, layout);
}

fn draw_entries(
    frame: &mut Frame,
    entries: &[Vec<Line<'static>>],
    help: &Help,
    layout: &mut ScreenLayout,
) {
    let area = frame.area();
    let width = without_slivers(area, HELP_WIDTH);
    let text = entries.concat();
    let all = if help.search().is_empty() { text.clone() } else { matches(entries, help.search()) };
    // The box keeps its size while lines are searched.
    let dialog_area = middle(area, width, (text.len() as u16 + 2).min(area.height));
    let height = usize::from(dialog_area.height.saturating_sub(2));
    let first = help.first.min(all.len().saturating_sub(height));
    let shown = first..(first + height).min(all.len());
    let title = if help.searching || !help.search().is_empty() {
        format!(" help: {}{} ", help.search(), if help.searching { "_" } else { "" })
    } else {
        " help ".to_owned()
    };
    frame.render_widget(Clear, dialog_area);
    let lines = all[shown.clone()].to_vec();
    frame.render_widget(Paragraph::new(lines).block(Block::bordered().title(title)), dialog_area);
    let room = dialog_area.width.saturating_sub(2);
    let bottom = dialog_area.bottom().saturating_sub(1);
    let foot = Rect { x: dialog_area.x + 1, y: bottom, width: room, height: 1 };
    buttons(shown, all.len(), usize::from(room)).draw(frame, foot, layout);
    layout.help_lines = Some(first..first + height);
}

/// Returns the buttons of the help, and which lines of how many are `shown` if that is not all.
fn buttons(shown: Range<usize>, all: usize, room: usize) -> ClickableLine {
    let mut bar = ClickableLine::default();
    bar.push(Span::raw(" /: search "), None);
    bar.push(Span::raw(" Esc: close "), Click::Close);
    if shown.len() < all {
        let (first, last) = (shown.start + 1, shown.end);
        let long = format!(" {first} to {last} of {all}: arrows, PgUp, PgDn ");
        let text = if bar.width() + long.len() <= room { long } else { format!(" {last}/{all} ") };
        bar.push(Span::styled(text, DIM), None);
    }
    bar
}

fn matches(entries: &[Vec<Line<'static>>], typed: &str) -> Vec<Line<'static>> {
    let words: Vec<String> = typed.to_lowercase().split_whitespace().map(str::to_owned).collect();
    let found = |entry: &&Vec<Line>| {
        let text = entry.iter().map(Line::to_string).collect::<Vec<_>>().join(" ").to_lowercase();
        words.iter().all(|word| text.contains(word.as_str()))
    };
    let found: Vec<Line> = entries.iter().filter(found).flatten().cloned().collect();
    if found.is_empty() {
        vec![Line::styled(" no match: Esc shows everything", REVERSED)]
    } else {
        found
    }
}

/// Returns all entries and titles, each as its lines, wrapped to `width`.
fn entries(screen: &Screen, scene: &Scene, width: usize, help: &Help) -> Vec<Vec<Line<'static>>> {
    let key = screen.keymap.key_of(Action::Palette);
    let (introduction, modes) = match &help.comparison {
        Some(introduction) => (&**introduction, &OF_COMPARISONS[..]),
        None => (scene.introduction(), &OF_RUNS[..]),
    };
    let is_active = |b: &Binding| modes.iter().any(|mode| b.is_active(*mode));
    let finds = bindings().any(|b| b.action == Action::Palette && is_active(b));
    let how = format!(
        " Where the help shows \"{key} ...\" instead of a key, type {key} and some letters."
    );
    let mut introduction = introduction.to_owned();
    if screen.theme.depth == ColourDepth::Mono {
        introduction = introduction.replace("light near, dark far", "the denser, the farther");
        introduction = introduction.replace("Colours show", "Shades show");
    }
    let introduction = introduction + if finds { &how } else { "" };
    let introduction = wrapped(&introduction, width.saturating_sub(2).max(8));
    let mut entries = vec![
        introduction.into_iter().map(|line| Line::raw(format!(" {line}"))).collect::<Vec<_>>(),
    ];
    let title =
        |title: &str| [vec![Line::default()], vec![Line::styled(format!(" {title}"), BOLD)]];
    for section in SECTIONS {
        let listed = |b: &&Binding| scene.offers(b.action) && is_active(b);
        let mut bindings = section.bindings.iter().filter(listed).peekable();
        if bindings.peek().is_none() {
            continue;
        }
        entries.extend(title(section.title));
        for binding in bindings {
            let keys = screen.keymap.display_keys(binding).join(" ");
            let keys = if keys.is_empty() { screen.keymap.key_of(binding.action) } else { keys };
            let meaning = format!("{}{}", scene.wording(binding), binding.place());
            entries.push(entry(&keys, &meaning, width));
        }
    }
    entries.extend(title("the numbers"));
    for (name, meaning) in training::MEANINGS.iter().chain(WALK_MEANINGS) {
        entries.push(entry(name, meaning, width));
    }
    entries.push(vec![Line::default()]);
    entries.extend(scene.legend_lines(screen).into_iter().map(|line| vec![line]));
    if let Some(folder) = crate::host::logging::folder() {
        entries.push(vec![Line::default()]);
        entries.push(entry("log files", &folder.display().to_string(), width));
    }
    entries
}

fn entry(name: &str, meaning: &str, width: usize) -> Vec<Line<'static>> {
    let names = if width >= WIDE { NAME_WIDTH } else { NARROW_NAME_WIDTH };
    let rows = wrapped(meaning, width.saturating_sub(names + 4).max(8));
    let line = |(n, row): (usize, String)| {
        let name = if n == 0 { name } else { "" };
        Line::from(vec![Span::styled(format!(" {name:>names$}  "), BOLD), Span::raw(row)])
    };
    rows.into_iter().enumerate().map(line).collect()
}
