//! What the screen says after keys and clicks.
//!
//! A row is what is shown, its size, what is pressed, the texts that the screen must have then, and
//! those that it must not have. Names in braces are keys; `{click TEXT}` clicks on the first place
//! that shows a text.

use super::staged::staged_app;
use super::*;
use crate::tui::runs::tests::screen;
use TestScreen::*;

#[derive(Clone, Copy, Debug)]
enum TestScreen {
    /// A run that has just begun, of a method with bridges or without.
    New,
    Actor,
    /// The same on a map that is larger than the screen.
    Wide,
    /// The same with hints for a first run.
    First,
    /// A run in progress, the same without colours, and with a film.
    Run,
    Mono,
    Filmed,
    /// The arm with a wall, and a space of goals.
    Arm,
    Goals,
    /// A comparison, and a list of runs.
    Both,
    List,
}

impl TestScreen {
    fn set_up(self, width: u16, height: u16) -> Box<dyn Driven> {
        match self {
            New => Box::new(still()),
            Actor => Box::new(still_on(rooms(), gdg())),
            Wide => Box::new(still_on(Grid::empty("wide", 250, 200), gdg())),
            First => {
                let mut app = still();
                app.screen.explains = true;
                Box::new(app)
            }
            Run => Box::new(staged_app(width, height)),
            Mono => {
                let mut app = staged_app(width, height);
                app.screen.theme = Theme::new(ThemeName::Dark, ColourDepth::Mono);
                Box::new(app)
            }
            Filmed => Box::new(past::filmed_app(&[1, 2_500, 5_000], width, height)),
            Arm => Box::new(spaces::staged_arm(width, height)),
            Goals => Box::new(spaces::staged_goals(width, height)),
            Both => Box::new(compare::staged(width.max(60), height.max(18))),
            List => Box::new(screen()),
        }
    }
}

/// A stage, a size, keys, texts that must be there, and texts that must not.
type ScreenTest =
    (TestScreen, (u16, u16), &'static str, &'static [&'static str], &'static [&'static str]);

const TINY: (u16, u16) = (40, 12);
const NARROW: (u16, u16) = (60, 20);
const SMALL: (u16, u16) = (80, 24);
const LARGE: (u16, u16) = (120, 40);
const HUGE: (u16, u16) = (200, 60);

const ROWS: &[ScreenTest] = &[
    // What a screen has room for.
    (Run, SMALL, "", &["Space pause", "n goal", "v view", "e edit", "? help"], &[]),
    (Run, HUGE, "", &["elapsed", "waypoint", "exploring", "q quit"], &["critic: error"]),
    (New, TINY, "", &["Space pause", "? help", "q quit"], &[]),
    (Wide, SMALL, "", &["1 dot = "], &[]),
    (First, SMALL, "", &["light = near G", "click sets a goal", "? help"], &[]),
    (First, SMALL, "v", &["D from S", "click sets a goal"], &["light = near G"]),
    (First, SMALL, "n", &[], &["click sets a goal"]),
    // Training.
    (New, SMALL, " ", &["paused  y now", "Space train", "a actor", "e edit"], &[]),
    (New, SMALL, "{click pause}", &["paused"], &[]),
    // Help, the list of all actions, and keys without a meaning.
    (New, TINY, "?", &["the learned distance", "pause or"], &[]),
    (New, SMALL, "?undo", &["undo an edit"], &["pause or resume"]),
    (New, SMALL, "?s", &["> s", "put @ at the cursor or goal", "save a checkpoint"], &["pause or"]),
    (New, SMALL, "?create", &["open another map", "open or close the editor"], &[]),
    (New, SMALL, "??", &["q quit"], &["pause or resume"]),
    (New, SMALL, "?via graph", &["the same for D along the bridge graph"], &[]),
    (New, SMALL, "{click ? help}", &["pause or resume"], &[]),
    (New, SMALL, ":pause{enter}", &["paused  y now"], &[]),
    (New, SMALL, ":qqqzzz{enter}", &["nothing fits \"qqqzzz\""], &[]),
    (New, SMALL, ":polyak{enter}", &["tau"], &[]),
    (New, SMALL, ":colours visits{enter}", &["visits"], &[]),
    (New, SMALL, "{f9}", &["F9 does nothing here: ? lists all keys"], &[]),
    // Questions about the run, and settings.
    (New, SMALL, "{click gdg-bridge}", &["method (replay is kept"], &[]),
    (New, SMALL, "{click default}", &["preset (replay is kept"], &[]),
    (New, SMALL, "{click seed}", &["restart with seed"], &[]),
    (Run, SMALL, "q", &["unsaved updates", " y save and quit"], &["type to search"]),
    (Run, SMALL, "qn", &["q quit"], &["save and quit"]),
    (New, SMALL, "orandom_actions{enter}{ctrl-u}lots{enter}", &["random_actions cannot be"], &[]),
    (New, SMALL, "orandom_actions{enter}{ctrl-u}0.5{enter}", &["*random_actions         0.5"], &[]),
    (New, SMALL, "o{enter}her{enter}{esc}", &[" her "], &["* differs"]),
    (New, SMALL, ":polyak{enter}{ctrl-u}0.5{enter}", &["4 changed"], &["* differs"]),
    (Run, SMALL, "R", &[" y save, then start", " d start with seed 2, unsaved"], &["..."]),
    (Run, LARGE, "e{enter}eOtrap{enter}", &["and map edits are lost"], &[]),
    // Typing replaces the answer that is there, unless it was edited.
    (New, SMALL, "ohidden{enter}7", &["> 7 "], &[]),
    (New, SMALL, "ohidden{enter}{backspace}7", &["> 17 "], &[]),
    (New, SMALL, "E", &["map as PNG", "curves as CSV"], &[]),
    (New, SMALL, "T{down}", &["dark text on a light page"], &[]),
    (New, SMALL, "T{click light   }", &["gdg-tui"], &["type to search"]),
    (New, SMALL, ":save a checkpoint under{enter}name{click Enter accept}", &["name.safe"], &[]),
    (New, SMALL, "{click gdg-bridge}her{enter}:save-as{enter}", &["-her-seed"], &[]),
    // Panes.
    (New, SMALL, "{click legend}", &["bridge edges", "contours"], &[]),
    (New, NARROW, "{tab}", &["updates"], &["D to G"]),
    (Run, (66, 20), "", &["unsaved"], &[" saved"]),
    (New, NARROW, "M", &["0:00:00 gdg-bridge on rooms, 20 x 5 cells", "(update"], &["accept"]),
    (New, SMALL, "z", &["updates", "replay"], &["D to G"]),
    (Run, SMALL, "z", &["loss of D", "critic: error of the distance D it learns"], &[]),
    (Run, LARGE, "2", &["waypoint", "walk"], &[]),
    (New, SMALL, ":marker{enter}", &["marker: pixels (not supported here"], &[]),
    (New, SMALL, "i", &["cell 19,4", "CELL Enter goal", "i done", "arrows move"], &[]),
    (New, SMALL, "iv", &["cell 19,4", "D from S"], &[]),
    (New, SMALL, "Z", &["has one projection"], &[]),
    // Over the wall at column 10, and not beyond the map.
    (New, SMALL, "hhhhhhhhhji", &["cell 9,4"], &[]),
    (New, SMALL, "hhhhhhhhhki", &["cell 9,3"], &[]),
    // What there is not is not in the legend.
    (Actor, SMALL, "b", &["gdg has no bridges"], &[]),
    (Actor, SMALL, "?method{enter}", &["method (replay is kept"], &[]),
    (Actor, SMALL, "", &["v view  Tab panes"], &["a actor"]),
    (Actor, SMALL, "4", &["contours"], &["bridge", "planned path"]),
    (Mono, SMALL, "c", &["contour lines need colours"], &[]),
    (Mono, SMALL, "4", &["bridge edges"], &["contours"]),
    (Mono, SMALL, "?", &["the denser, the farther"], &["light near"]),
    // The editor.
    (New, SMALL, "e", &["EDIT", "1 wall", "done"], &[]),
    (New, SMALL, "e?", &["shown as s and g", "right-drag: floor)  "], &["pause or"]),
    (New, SMALL, "es", &["s does nothing in the editor"], &[]),
    (New, SMALL, "{click e edit}{click done}", &[], &["EDIT"]),
    (New, LARGE, "e{click box}", &["drag: an outline"], &["drag: walls"]),
    (New, LARGE, "e7", &["click: add, remove g"], &["drag: walls"]),
    (New, SMALL, "u", &["nothing to undo"], &[]),
    (New, SMALL, "{ctrl-r}", &["nothing to redo"], &[]),
    (New, SMALL, "e5{enter}", &["not filled: a map needs floor"], &[]),
    (New, SMALL, "ehhhhhhhhh6{enter}", &["a start needs floor"], &[]),
    (New, SMALL, "ehhhhhhhhh7{enter}", &["a goal needs floor"], &[]),
    // Looking back.
    (New, SMALL, "[", &["no film yet"], &[]),
    (Filmed, SMALL, "]", &["present"], &[]),
    (Filmed, LARGE, "[", &["update 5,000", "Esc now"], &[]),
    (Filmed, LARGE, "[[", &["update 2,500"], &[]),
    (Filmed, LARGE, "[[]", &["update 5,000"], &[]),
    (Filmed, LARGE, "[{esc}", &[], &["update 5,000", "Esc now"]),
    // Worlds without a map.
    (Arm, SMALL, "", &["fetch-reach", "side", "D to G"], &[]),
    (Arm, HUGE, "", &["side", "front", "top", "free"], &[]),
    (Arm, SMALL, "P", &["front"], &[]),
    (Arm, SMALL, "e", &["fetch-reach cannot be edited"], &["EDIT"]),
    (Arm, SMALL, ":editor", &[], &["open the map editor"]),
    (Goals, SMALL, "", &["g0\u{2192}", "g1\u{2191}", " train  curves  walk  legend"], &[]),
    (Goals, HUGE, "2", &["loss of D"], &["error of D"]),
    // Comparisons.
    (Both, LARGE, "", &["s save  ? help", "A gdg-bridge", "B gdg", "arrived 4 steps"], &[]),
    (Both, LARGE, "?races", &["in comparisons, races from one start"], &[]),
    (New, SMALL, "olr", &["learning_rate"], &["n_step"]),
    (Both, LARGE, "?legend", &["bridge candidates", "start of @"], &["nothing fits"]),
    (Both, LARGE, "o", &["not in a comparison"], &[]),
    (Both, SMALL, "[", &["no film yet"], &[]),
    (Both, SMALL, "e", &["EDIT", "save map"], &[]),
    (Both, LARGE, "E", &["map as PNG"], &[]),
    // Lists of runs.
    (List, LARGE, "", &["5 runs", "fourrooms", "m mark", "Enter open", "? help"], &[]),
    (List, NARROW, "", &["m mark", "Enter open", "? help", "q quit"], &[]),
    (List, (24, 6), "", &["needs 60", "24 x 6"], &[]),
    (List, LARGE, "mjm", &["\u{2500} A ", "\u{2500} B "], &[]),
    (List, LARGE, "mjm{esc}", &[], &["\u{2500} A "]),
    (List, LARGE, "/rooms her", &["2 of 5 runs"], &["fourrooms"]),
    (List, SMALL, "/qqq", &["no run has \"qqq\": Esc shows all"], &["not evaluated yet"]),
    (List, SMALL, "/her{enter}", &["with words: her", "Esc all"], &[]),
    (List, SMALL, "{end}{up}m{up}m", &["setting ", "gdg-bridge gdg"], &[]),
    (List, LARGE, "{end}{up}m", &["\u{2500} A fourrooms ", " 4,000 "], &[]),
    (List, LARGE, "{end}{up}m?curves over{enter}", &["success over environment steps"], &[]),
    (List, LARGE, "x", &["x does nothing here", "Enter open", "q quit"], &[]),
    (List, LARGE, "{right}{right}{right}{left}r", &["file\u{2191}"], &["written\u{2193}"]),
    (List, LARGE, "m{down}m", &["Enter compare"], &["Enter open"]),
    (List, SMALL, "", &["planned", "alone", "state", "by written\u{2193}"], &[]),
    (List, LARGE, "{enter}", &["it has no checkpoint"], &[]),
    (
        List,
        LARGE,
        "D",
        &["delete 1 file?", "n keep", "d delete", "the report stays"],
        &["type to search"],
    ),
    (List, SMALL, "?", &["mark the selected run", "...  m"], &[]),
    (List, LARGE, "?mark{enter}", &["\u{2500} A "], &[]),
];

fn play(app: &mut dyn Driven, (width, height): (u16, u16), keys: &str) {
    let mut rest = keys;
    while let Some(first) = rest.chars().next() {
        let named = rest.strip_prefix('{').and_then(|rest| rest.split_once('}'));
        match named.map(|(name, _)| (name, name.strip_prefix("click "))) {
            Some((_, Some(text))) => {
                let at = place_of(&shown_by(app, width, height), text);
                click(app, MouseButton::Left, at);
            }
            Some((name, None)) => {
                let combination = crokey::parse(name).expect("a key");
                let crokey::OneToThree::One(code) = combination.codes else { panic!("{name}") };
                press_with(app, code, combination.modifiers);
            }
            None => press(app, KeyCode::Char(first)),
        }
        rest = named.map_or_else(|| &rest[first.len_utf8()..], |(_, rest)| rest);
        app.obey();
        draw(app, width, height);
    }
}

#[test]
fn the_screen_says_what_it_should_after_keys_and_clicks() {
    let mut failures = String::new();
    for (stage, size @ (width, height), keys, has, lacks) in ROWS {
        let mut app = stage.set_up(*width, *height);
        draw(&mut *app, *width, *height);
        play(&mut *app, *size, keys);
        let shown = shown_by(&mut *app, *width, *height);
        let missing = has.iter().filter(|text| !shown.contains(**text));
        let unwanted = lacks.iter().filter(|text| shown.contains(**text));
        for text in missing.chain(unwanted) {
            failures += &format!("{stage:?} at {size:?} after {keys:?}: {text:?}\n{shown}\n\n");
        }
    }
    assert!(failures.is_empty(), "{failures}");
}
