//! The table of all actions.

use super::{Action as A, Binding, Both, ListAction, Section, When};
use crate::tui::compare::Comparison;
use crate::tui::dialog::{Dialog, Help};
use crate::tui::interface::TerminalRequest;
use crate::tui::layers::Overlay;
use crate::tui::lists;
use crate::tui::output::ExportKind;
use crate::tui::panes::Pane;
use crate::tui::session::{Session, files, runs, saving, time, view};

use crate::tui::tool::Tool;
use gdg::engine::Step;

/// A row for an action that `run` performs.
const fn bind(
    action: A,
    name: &'static str,
    keys: &'static [&'static str],
    run: fn(&mut Session, A),
) -> Binding {
    let both = Both::Refused("only single runs have it");
    let (when, is_about_present, is_in_lists) = (When::Always, false, false);
    let (short, long, words) = ("", "", "");
    Binding {
        action,
        name,
        when,
        keys,
        short,
        long,
        words,
        run,
        both,
        is_about_present,
        is_in_lists,
    }
}

/// The same while the editor is closed.
const fn watch(
    action: A,
    name: &'static str,
    keys: &'static [&'static str],
    run: fn(&mut Session, A),
) -> Binding {
    bind(action, name, keys, run).watching()
}

/// A row for an action that the scene performs.
const fn scene(action: A, name: &'static str, keys: &'static [&'static str]) -> Binding {
    bind(action, name, keys, Session::act_in_scene)
}

const fn watch_scene(action: A, name: &'static str, keys: &'static [&'static str]) -> Binding {
    scene(action, name, keys).watching()
}

/// A row for an overlay.
const fn overlay(overlay: Overlay, name: &'static str, keys: &'static [&'static str]) -> Binding {
    watch(A::Toggle(overlay), name, keys, |s, action| view::toggle_overlay(s, action)).each()
}

/// A row for a pane.
const fn pane(pane: Pane, name: &'static str, keys: &'static [&'static str]) -> Binding {
    bind(A::Show(pane), name, keys, |s, action| view::show(s, action)).watching().alone(NO_PANES)
}

/// A row for an action of the editor.
const fn edit(action: A, name: &'static str, keys: &'static [&'static str]) -> Binding {
    scene(action, name, keys).own(Comparison::edit).in_present()
}

/// The same while the editor is open.
const fn tool(action: A, name: &'static str, keys: &'static [&'static str]) -> Binding {
    edit(action, name, keys).within(When::Editing)
}

/// A row for an action on a list of runs, which knows what it does.
const fn on_runs(action: ListAction, name: &'static str, keys: &'static [&'static str]) -> Binding {
    bind(A::List(action), name, keys, |_, _| {}).within(When::Listing)
}

impl Binding {
    const fn help(self, long: &'static str) -> Self {
        Self { long, ..self }
    }

    /// Describes it, with other words to search for.
    const fn about(self, long: &'static str, words: &'static str) -> Self {
        Self { long, words, ..self }
    }

    /// Makes the binding active only while the editor is closed.
    const fn watching(self) -> Self {
        self.within(When::Watching)
    }

    const fn within(self, when: When) -> Self {
        Self { when, ..self }
    }

    /// Adds a word for the footer.
    const fn short(self, short: &'static str) -> Self {
        Self { short, ..self }
    }

    /// Adds search words.
    const fn also(self, words: &'static str) -> Self {
        Self { words, ..self }
    }

    /// Returns to the present first.
    const fn in_present(self) -> Self {
        Self { is_about_present: true, ..self }
    }

    /// Has it in lists of runs, too.
    const fn in_lists(self) -> Self {
        Self { is_in_lists: true, ..self }
    }

    const fn each(self) -> Self {
        Self { both: Both::Each, ..self }
    }

    const fn first(self) -> Self {
        Self { both: Both::First, ..self }
    }

    const fn own(self, act: fn(&mut Comparison, A)) -> Self {
        Self { both: Both::Own(act), ..self }
    }

    /// Says why comparisons do not have it.
    const fn alone(self, why: &'static str) -> Self {
        Self { both: Both::Refused(why), ..self }
    }
}

const NOTHING_SAVED: &str =
    "it saves and loads nothing: gdg-tui MAP --method METHOD trains a run that is saved";
const CHOSEN_AT_START: &str =
    "methods, settings and seed are chosen at the start: gdg-tui compare --help";
const ONE_MAP: &str =
    "both stay on their map, which can be edited; gdg-tui compare A B MAP begins on another";
const FULL_SPEED: &str = "each side trains as fast as it can";
const NO_PANES: &str = "facts and curves are always shown, there are no panes";
const IN_A_SHELL: &str = "quit first, then start it in a shell";

/// A command that compares two methods.
const HOW_TO_COMPARE: &str =
    "in a shell: gdg-tui compare gdg-bridge gdg shows both on the same map";

/// All actions, by section.
pub const SECTIONS: &[Section] = &[
    Section { title: "training", bindings: TRAINING },
    Section { title: "goal and agent", bindings: GOAL_AND_AGENT },
    Section { title: "view", bindings: VIEW },
    Section { title: "panes", bindings: PANES },
    Section { title: "map editor", bindings: MAP_EDITOR },
    Section { title: "files", bindings: FILES },
    Section { title: "program", bindings: PROGRAM },
    Section { title: "comparison (gdg-tui compare)", bindings: COMPARISON },
    Section { title: "runs (gdg-tui runs)", bindings: RUNS },
];

const TRAINING: &[Binding] = &[
    bind(A::TogglePause, "pause", &["space"], |s, _| time::toggle_pause(s))
        .help("pause or resume training")
        .short("pause")
        .also("stop halt continue unpause play start run go wait")
        .own(Comparison::toggle_pause),
    bind(A::StepUpdate, "step-update", &["."], |s, _| time::step(s, Step::Update))
        .about("run one update, then pause", "single step advance gradient")
        .each(),
    bind(A::StepEpisode, "step-episode", &[","], |s, _| time::step(s, Step::Episode))
        .about("train until an episode ends, then pause", "next step advance")
        .each(),
    bind(A::Faster, "faster", &[">"], |s, _| time::change_speed(s, true))
        .help("more updates per second")
        .also("speed fast quick rate limit unlimited accelerate max maximum forward")
        .alone(FULL_SPEED),
    bind(A::Slower, "slower", &["<"], |s, _| time::change_speed(s, false))
        .about("fewer updates per second", "speed slow down rate limit throttle")
        .alone(FULL_SPEED),
    watch(A::Freeze, "freeze", &["shift-f"], |s, _| s.screen.frozen = !s.screen.frozen)
        .help("freeze the screen while training continues")
        .also("still hold lock display")
        .each(),
    bind(A::Evaluate, "evaluate", &["y"], |s, _| time::evaluate(s))
        .help("evaluate now: how many test walks reach their goals")
        .also("evaluation test measure score success rate benchmark accuracy performance")
        .each(),
    watch(A::NewSeed, "new-seed", &["shift-r"], |s, _| runs::ask_seed(s))
        .help("restart with another seed")
        .also("reset again scratch random number new run start over")
        .alone(CHOSEN_AT_START),
    watch(A::Settings, "settings", &["o"], |s, _| s.open_settings())
        .help("change a setting during training")
        .also(
            "options preferences parameters hyperparameters configuration configure \
             learning rate batch size gamma discount lr bigger network width hidden \
             layers neurons units noise epsilon optimizer episode length number agents \
             parallel",
        )
        .alone(CHOSEN_AT_START),
    bind(A::ResetSetting, "reset-setting", &["delete", "ctrl-x"], |s, _| runs::reset_setting(s))
        .help("reset the selected setting")
        .within(When::Settings)
        .alone(CHOSEN_AT_START),
    bind(A::Method, "method", &[], |s, _| {
        s.open(lists::methods(&s.screen.run().method, &s.screen.snapshot.registry));
    })
    .help("change to another method, keeping the data")
    .also("algorithm learner planner switch gdg gdg-bridge her ddpg sorb rival baseline reward")
    .alone(CHOSEN_AT_START),
    bind(A::Preset, "preset", &[], |s, _| s.open(lists::presets(s.screen.run().preset)))
        .about("change to the settings of a preset", "defaults paper tuned sb3 profile")
        .alone(CHOSEN_AT_START),
];

const GOAL_AND_AGENT: &[Binding] = &[
    watch(A::NewGoal, "new-goal", &["n"], Session::act_on_goal)
        .help("a random new goal (or click on the map)")
        .short("goal")
        .also("target destination next change set")
        .own(Comparison::new_goal)
        .in_present(),
    towards(A::Move(-1, 0), "left", &["left", "h"]).help("move the goal or cursor left"),
    towards(A::Move(0, 1), "down", &["down", "j"]).help("move the goal or cursor down").in_lists(),
    towards(A::Move(0, -1), "up", &["up", "k"]).help("move the goal or cursor up").in_lists(),
    towards(A::Move(1, 0), "right", &["right", "l"]).help("move the goal or cursor right"),
    watch_scene(A::NewStart, "new-start", &["w"])
        .help("put @ at a random place (right-click: at that cell)")
        .also("start agent walker position move teleport spawn")
        .own(Comparison::new_start)
        .in_present(),
    watch_scene(A::StartHere, "start-here", &["shift-s"])
        .about("put @ at the cursor or goal", "start agent walker position teleport")
        .own(Comparison::start_here)
        .in_present(),
    watch(A::GoalHere, "goal-here", &["enter"], Session::act_on_goal)
        .help("put the goal at the cursor")
        .also("target set")
        .own(Comparison::move_goal)
        .in_present(),
    watch(A::OnArrival, "on-arrival", &["t"], |s, _| view::next_on_arrival(s))
        .help("when @ arrives: restart, visit other goals, or stay")
        .also("tour loop repeat")
        .own(Comparison::next_on_arrival),
];

/// A row for an arrow key.
const fn towards(action: A, name: &'static str, keys: &'static [&'static str]) -> Binding {
    bind(action, name, keys, Session::act_on_goal).own(Comparison::move_goal)
}

const VIEW: &[Binding] = &[
    watch(A::Field(true), "next-field", &["v"], |s, _| view::next_field(s, true))
        .help("colour the map by the next quantity")
        .short("view")
        .also("view field distance heatmap visits error truth value function layer mode")
        .own(Comparison::next_field)
        .in_present(),
    watch(A::Field(false), "previous-field", &["shift-v"], |s, _| view::next_field(s, false))
        .help("colour the map by the previous quantity")
        .also("view field distance heatmap back")
        .own(Comparison::next_field)
        .in_present(),
    overlay(Overlay::Contours, "contours", &["c"])
        .about("contour lines, on or off", "isolines levels overlay layer hide show"),
    overlay(Overlay::Unexplored, "unvisited", &["x"])
        .help("unvisited cells and their edge, on or off")
        .also("unexplored exploration frontier fog coverage overlay layer hide show"),
    overlay(Overlay::Agents, "agents", &["a"])
        .help("exploring agents, trails, frontier goals, on or off")
        .also("explorers robots dots overlay layer hide show"),
    overlay(Overlay::Candidates, "candidates", &["b"])
        .help("bridge candidates, on or off (zoom in for more)")
        .also("bridges points nodes waypoints overlay layer hide show"),
    overlay(Overlay::Edges, "edges", &["d"])
        .about("edges of the bridge graph, on or off", "graph links lines overlay layer hide show"),
    overlay(Overlay::Search, "search", &["shift-b"])
        .about("the latest search for a bridge point, on or off", "bridge overlay layer"),
    overlay(Overlay::Path, "path", &["p"])
        .about("the path planned by @, on or off", "plan route waypoints overlay layer hide show"),
    watch_scene(A::Inspect, "inspect", &["i"])
        .help("inspect cells with a cursor")
        .also("cursor look value info cell query coordinates position hover")
        .each(),
    scene(A::ZoomIn, "zoom-in", &["+", "="])
        .about("zoom in (or mouse wheel)", "magnify larger bigger closer enlarge minimap")
        .each(),
    scene(A::ZoomOut, "zoom-out", &["-"]).about("zoom out", "smaller farther shrink").each(),
    watch_scene(A::ZoomOff, "whole-map", &["0"])
        .about("show the whole map", "fit all reset zoom overview")
        .each(),
    scene(A::Pan(-1, 0), "pan-left", &["shift-left", "alt-left"])
        .about("pan the map to the left", "scroll")
        .each(),
    scene(A::Pan(1, 0), "pan-right", &["shift-right", "alt-right"])
        .about("pan the map to the right", "scroll")
        .each(),
    scene(A::Pan(0, -1), "pan-up", &["shift-up", "alt-up"])
        .about("pan the map upwards", "scroll")
        .each(),
    scene(A::Pan(0, 1), "pan-down", &["shift-down", "alt-down"])
        .about("pan the map downwards", "scroll")
        .each(),
    watch(A::Back, "back-in-time", &["["], |s, _| time::step_through_film(s, false))
        .help("go back in time: what was learned by then")
        .also("past history film rewind earlier previous before go time travel scrub movie replay")
        .each(),
    watch(A::Forth, "forth-in-time", &["]"], |s, _| time::step_through_film(s, true))
        .help("go forward in time, up to the present")
        .also("future now present film forward later next time travel movie replay")
        .each(),
    watch_scene(A::Projection, "projection", &["shift-p"])
        .help("choose the next projection")
        .short("projection")
        .also("side top front orbit rotate camera angle"),
    watch_scene(A::Alone, "alone", &["shift-z"])
        .about("show the chosen projection alone, or all", "single full"),
    watch(A::Marker, "marker", &["m"], |s, _| view::change_marker(s))
        .help("pixels, half blocks, quadrants or braille")
        .also("characters symbols pixels resolution font")
        .each(),
    watch(A::Theme, "theme", &["shift-t"], |s, _| s.open(lists::themes(s.screen.theme.name)))
        .help("dark, light or colour-blind-safe")
        .also("themes colors color scheme mode palette black white accessibility")
        .alone("the theme is chosen in the configuration: gdg-tui --print-config-template"),
];

const PANES: &[Binding] = &[
    pane(Pane::Training, "training", &["1"])
        .about("training progress and success", "statistics numbers pane panel"),
    pane(Pane::Curves, "curves", &["2"])
        .help("curves of success, coverage, losses and errors")
        .also("plots charts graphs history loss td bellman error tensorboard pane panel"),
    pane(Pane::Walk, "walk", &["3"]).about("the walking agent", "pane panel"),
    pane(Pane::Legend, "legend", &["4"])
        .about("legend of the map", "key meaning symbols overlays layers signs pane panel"),
    pane(Pane::Log, "log", &["5"])
        .about("event log", "messages events history notices errors pane panel"),
    bind(A::NextPane, "next-pane", &["tab"], |s, _| view::show_next(s))
        .help("select the next pane")
        .short("panes")
        .also("panel tab switch")
        .alone(NO_PANES),
    watch(A::Maximise, "maximise", &["z"], |s, _| s.screen.maximised = !s.screen.maximised)
        .help("maximise or restore the pane")
        .also(
            "maximize full screen fullscreen enlarge large pane panel sidebar explain \
             meaning",
        )
        .alone(NO_PANES),
    bind(A::Scroll(-1), "scroll-back", &["pageup"], |s, _| s.screen.scroll(-1))
        .about("scroll curves and log back", "page up earlier")
        .alone(NO_PANES),
    bind(A::Scroll(1), "scroll-on", &["pagedown"], |s, _| s.screen.scroll(1))
        .about("scroll curves and log forward", "page down later")
        .alone(NO_PANES),
    watch(A::LogScale, "log-scale", &["g"], |s, _| view::change_curve_scale(s))
        .help("toggle logarithmic curves")
        .also("log axis linear")
        .alone(NO_PANES),
    watch(A::LayUnder, "lay-under", &["shift-u"], |s, _| files::pick_under(s))
        .help("show a saved run's curves behind these, or remove them")
        .also("compare yesterday earlier saved reference baseline overlay behind checkpoint")
        .alone("gdg-tui runs lays the curves of more runs over each other"),
];

const MAP_EDITOR: &[Binding] = &[
    edit(A::ToggleEdit, "edit", &["e"])
        .help("open or close the editor")
        .short("edit")
        .also("draw walls change map modify doors"),
    tool(A::Tool(Tool::Pencil), "pencil", &["1"])
        .help("draw walls (drag; right-drag: floor)")
        .also("block obstacle"),
    tool(A::Tool(Tool::Eraser), "eraser", &["2"])
        .help("draw floor")
        .also("erase remove delete wall"),
    tool(A::Tool(Tool::Line), "line", &["3"]).help("draw a straight wall"),
    tool(A::Tool(Tool::Rectangle), "rectangle", &["4"])
        .help("draw walls around a rectangle")
        .also("box room"),
    tool(A::Tool(Tool::Fill), "fill", &["5"])
        .help("fill an area with wall, or a wall with floor")
        .also("bucket flood"),
    tool(A::Tool(Tool::Start), "start", &["6"]).help("add or remove a start S"),
    tool(A::Tool(Tool::Goal), "goal", &["7"]).help("add or remove a goal G"),
    tool(A::Apply, "apply", &["x", "enter"]).help("use the tool at the cursor; twice for a line"),
    edit(A::Undo, "undo", &["u"]).about("undo an edit", "revert back"),
    edit(A::Redo, "redo", &["ctrl-r"]).about("redo an edit", "repeat again"),
    scene(A::NewMap, "new-map", &[])
        .about("create an empty map", "blank clear world")
        .alone(ONE_MAP),
    bind(A::RandomMap, "random-map", &[], |s, _| s.open(lists::random_maps()))
        .about("open a random map", "generate maze city perfect labyrinth new world")
        .alone(ONE_MAP),
    scene(A::ResizeMap, "resize-map", &[])
        .about("resize the map", "size width height crop grow")
        .alone(ONE_MAP),
    scene(A::SaveMap, "save-map", &["ctrl-w"])
        .about("write the map to a file", "save export store world")
        .first(),
    bind(A::OpenMap, "open-map", &["shift-o"], |s, _| files::pick_map(s, None))
        .help("open another map")
        .also("load map file choose switch world fourrooms city trap arm robot fetch-reach browse")
        .alone(ONE_MAP),
];

const FILES: &[Binding] = &[
    bind(A::Save, "save", &["s"], |s, _| s.save())
        .help("save a checkpoint")
        .short("save")
        .also("store write keep networks model weights")
        .alone(NOTHING_SAVED),
    bind(A::SaveAs, "save-as", &[], |s, _| saving::ask_file(s))
        .about("save a checkpoint under a name", "store write copy rename")
        .alone(NOTHING_SAVED),
    watch(A::Load, "load", &["shift-l"], |s, _| files::pick_checkpoint(s))
        .help("load a checkpoint")
        .also("open restore read resume run model weights")
        .alone(NOTHING_SAVED),
    bind(A::Resume, "resume", &["r"], |s, _| s.resume_offered())
        .help("resume the saved run")
        .within(When::Offered)
        .also("continue load saved go on")
        .alone(NOTHING_SAVED),
    bind(A::Autosave, "autosave", &[], |s, _| saving::ask_interval(s))
        .about("set the autosave interval", "automatic backup minutes")
        .alone(NOTHING_SAVED),
    watch(A::Export, "export", &["shift-e"], |s, _| {
        s.open(lists::exports(&ExportKind::ALL, s.scene.noun()));
    })
    .help("export map or curves")
    .also("screenshot picture image png svg csv figure capture print data")
    .alone("open a run by itself to export it"),
];

const PROGRAM: &[Binding] = &[
    bind(A::Tour, "guided-tour", &[], |s, _| s.offer_tour())
        .help("take the guided tour of the four rooms")
        .also(
            "tutorial demo introduction explain learn lesson beginner first steps teacher \
             student class",
        )
        .alone(IN_A_SHELL),
    bind(A::Compare, "compare", &[], |s, _| s.screen.notify(HOW_TO_COMPARE))
        .help("compare two methods side by side: how to start it")
        .also("comparison versus against race beside both rival baseline ablation")
        .alone(IN_A_SHELL),
    bind(A::NextTourStep, "next-step", &["enter", "right"], |s, _| s.guide.next_step(&mut s.cx))
        .help("next step of the tour (or click)")
        .within(When::Touring)
        .alone(IN_A_SHELL),
    bind(A::TogglePause, "pause-tour", &["p"], |s, _| time::toggle_pause(s))
        .help("pause or resume training and tour")
        .within(When::Touring),
    bind(A::EndTour, "end-tour", &["esc"], |s, _| s.guide.end(&mut s.cx))
        .help("end the tour")
        .within(When::Touring)
        .alone(IN_A_SHELL),
    bind(A::Palette, "palette", &[":", "ctrl-p"], |s, _| {
        s.open(lists::actions(&s.screen, &s.scene));
    })
    .help("find an action by name")
    .short("all")
    .also("command search")
    .own(Comparison::open_palette),
    bind(A::Help, "help", &["?", "f1"], |s, _| {
        s.screen.on_first_use();
        s.open(Dialog::Help(Help::default()));
    })
    .help("show or hide this help")
    .short("help")
    .also("keys shortcuts manual documentation bindings usage about")
    .own(Comparison::open_help)
    .in_lists(),
    bind(A::SearchHelp, "search-help", &["/"], |s, _| s.search_help())
        .help("search the help")
        .within(When::Help)
        .first(),
    bind(A::Close, "close", &["esc"], |s, _| view::close_top(s))
        .about("close the topmost dialog or mode", "cancel back escape")
        .own(Comparison::close_top)
        .in_lists(),
    bind(A::Redraw, "redraw", &["ctrl-l"], |s, _| s.ask_terminal(TerminalRequest::Redraw))
        .about("redraw the whole screen", "refresh repaint garbled again")
        .first()
        .in_lists(),
    bind(A::Suspend, "suspend", &["ctrl-z"], |s, _| s.ask_terminal(TerminalRequest::Suspend))
        .about("suspend to the shell; fg resumes", "background")
        .first()
        .in_lists(),
    bind(A::Quit, "quit", &["q", "ctrl-c"], |s, _| s.quit())
        .help("quit")
        .short("quit")
        .also("exit leave close end bye")
        .own(Comparison::quit)
        .in_lists(),
];

const COMPARISON: &[Binding] = &[
    beside(A::Axis, "axis", &["g"], |comparison, _| comparison.axis = comparison.axis.next())
        .help("curves over environment steps, seconds or updates")
        .short("axis"),
    beside(A::NextLarger, "next-larger", &["tab"], Comparison::next_larger)
        .help("left or right side larger, or both equal")
        .short("size"),
];

/// A row for an action that only comparisons have.
const fn beside(
    action: A,
    name: &'static str,
    keys: &'static [&'static str],
    act: fn(&mut Comparison, A),
) -> Binding {
    bind(action, name, keys, |_, _| {}).within(When::Comparing).own(act)
}

const RUNS: &[Binding] = &[
    on_runs(ListAction::Mark, "mark-run", &["space"]).short("mark").help(
        "mark the selected run, or unmark it (or click on it twice): marked runs are drawn together",
    ),
    on_runs(ListAction::Filter, "filter-runs", &["/"]).short("filter").help(
        "list only runs with all of the words typed: of map, method, settings and file; \
         seed=1 or hidden=64 must be equal",
    ),
    on_runs(ListAction::Resume, "resume-run", &["enter"])
        .short("resume")
        .help("resume the selected run"),
    on_runs(ListAction::Compare, "compare-runs", &["c"]).short("compare").help(
        "show side by side what two marked runs, or a marked and the selected one, have learned",
    ),
    on_runs(ListAction::Measure, "runs-curves", &["v"])
        .short("curves")
        .help("curves of success, success without plans, error of D, or what was explored"),
    on_runs(ListAction::Axis, "runs-axis", &["x"])
        .short("axis")
        .help("curves over updates, environment steps or seconds"),
    on_runs(ListAction::Sort, "sort-runs", &["s"])
        .short("sort")
        .help("sort by the next column (or click on its name; again reverses)"),
    on_runs(ListAction::Reverse, "reverse-runs", &["shift-s"]).help("reverse the order"),
    on_runs(ListAction::Delete, "delete-runs", &["delete", "shift-d"])
        .help("delete the files of the marked runs, or of the selected one; asks first"),
];
