//! The table of all actions, and how a row of it is performed.

use std::time::Instant;

use super::{Action as A, Binding, Both, Keys, ListAction, Mode, Section};
use crate::experiment::plot::Drawable;
use crate::tui::choices::{ExportKind, Overlay, Pane, Tool};
use crate::tui::compare::Comparison;
use crate::tui::interface::TerminalRequest;
use crate::tui::lists;
use crate::tui::session::{Session, change_run, disk, watching};
use gdg::engine::{EngineCommand, Step};

type Perform = fn(&mut Session, A);

const fn bind(action: A, name: &'static str, keys: Keys, run: Perform) -> Binding {
    let (both, when, is_about_present, is_in_lists) = (Both::Refused, None, false, false);
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
const fn watch(action: A, name: &'static str, keys: Keys, run: Perform) -> Binding {
    bind(action, name, keys, run).watching()
}

fn act_in_scene(session: &mut Session, action: A) {
    session.cx.scene.act(action, &mut session.cx.screen);
}

/// The same for the goal, after which nobody needs a hint how to set it.
fn act_on_goal(session: &mut Session, action: A) {
    session.screen.explains = false;
    act_in_scene(session, action);
}

const fn scene(action: A, name: &'static str, keys: Keys) -> Binding {
    bind(action, name, keys, act_in_scene)
}

const fn watch_scene(action: A, name: &'static str, keys: Keys) -> Binding {
    scene(action, name, keys).watching()
}

const fn overlay(overlay: Overlay, name: &'static str, keys: Keys) -> Binding {
    watch(A::Toggle(overlay), name, keys, |s, action| watching::toggle_overlay(s, action)).each()
}

const fn pane(pane: Pane, name: &'static str, keys: Keys) -> Binding {
    bind(A::Show(pane), name, keys, |s, action| watching::show(s, action)).watching()
}

const fn edit(action: A, name: &'static str, keys: Keys) -> Binding {
    scene(action, name, keys).own(Comparison::edit).in_present()
}

/// The same while the editor is open.
const fn tool(action: A, name: &'static str, keys: Keys) -> Binding {
    edit(action, name, keys).within(Mode::Editing)
}

/// A row for an action on a list of runs, which `act_on_list` in `runs.rs` performs.
const fn on_runs(action: ListAction, name: &'static str, keys: Keys) -> Binding {
    bind(A::List(action), name, keys, |_, _| {}).within(Mode::Listing)
}

impl Binding {
    /// Does it to a run, or says why its scene does not have it.
    pub fn perform(&self, session: &mut Session) {
        if !session.scene.offers(self.action) {
            let title = session.scene.title(&session.screen.snapshot);
            let text = match self.action {
                A::Projection | A::Alone => format!("{title} has one projection"),
                A::ToggleEdit => format!("{title} cannot be edited"),
                A::Toggle(Overlay::Ghost) => {
                    format!("{title}: the actor alone cannot begin in the state where a plan does")
                }
                own => {
                    format!("{} is for maps: {title} has none", session.screen.keymap.key_of(own))
                }
            };
            return session.screen.notify(&text);
        }
        if session.screen.elsewhere.is_some() && self.changes_run() {
            return session.screen.refuse_to_train();
        }
        if self.is_about_present {
            watching::leave_past(session);
        }
        let (began, dialogs) = (Instant::now(), session.screen.dialogs.len());
        (self.run)(session, self.action);
        if session.screen.dialogs.len() > dialogs {
            // An error that was there before says nothing about the new dialog.
            session.screen.log.notice.take_if(|(since, _)| *since < began);
        }
    }

    /// Whether it trains, changes, replaces or saves the run, which another program may do instead.
    pub fn changes_run(&self) -> bool {
        let is_change = |b: &Binding| b.action == self.action;
        [TRAINING, MAP_EDITOR, FILES].into_iter().flatten().any(is_change)
            && !matches!(self.action, A::SaveMap | A::Export | A::TrainCopy)
    }

    const fn help(self, long: &'static str) -> Self {
        Self { long, ..self }
    }

    const fn about(self, long: &'static str, words: &'static str) -> Self {
        Self { long, words, ..self }
    }

    /// Makes the binding active only while the editor is closed.
    const fn watching(self) -> Self {
        self.within(Mode::Watching)
    }

    const fn within(self, mode: Mode) -> Self {
        Self { when: Some(mode), ..self }
    }

    const fn short(self, short: &'static str) -> Self {
        Self { short, ..self }
    }

    const fn in_present(self) -> Self {
        Self { is_about_present: true, ..self }
    }

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
}

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
    bind(A::TogglePause, "pause", &["space"], |s, _| watching::toggle_pause(s))
        .about("pause or resume training", "stop halt continue unpause play start run go wait")
        .short("pause")
        .own(Comparison::toggle_pause),
    bind(A::StepUpdate, "step-update", &[], |s, _| watching::step(s, Step::Update))
        .about("run one update, then pause", "single step advance gradient")
        .each(),
    bind(A::StepEpisode, "step-episode", &[], |s, _| watching::step(s, Step::Episode))
        .about("train until an episode ends, then pause", "next step advance")
        .each(),
    bind(A::Faster, "faster", &[">"], |s, _| watching::change_speed(s, true))
        .about("more updates per second", "speed fast quick rate limit unlimited accelerate max"),
    bind(A::Slower, "slower", &["<"], |s, _| watching::change_speed(s, false))
        .about("fewer updates per second", "speed slow down rate limit throttle"),
    bind(A::Evaluate, "evaluate", &["y"], |s, _| _ = s.screen.command(EngineCommand::Evaluate))
        .about("evaluate now: how many walks reach their goals", "evaluation measure score")
        .each(),
    watch(A::NewSeed, "new-seed", &["shift-r"], |s, _| change_run::ask_to_restart(s))
        .about("restart with another seed", "reset again scratch random number new run start over"),
    watch(A::Settings, "settings", &["o"], |s, _| s.open(lists::settings(&s.screen)))
        .about("change a setting during training", "options preferences parameters"),
    bind(A::Method, "method", &[], |s, _| {
        s.open(lists::methods(&s.screen.run().method, &s.screen.snapshot.registry));
    })
    .about("change to another method, keeping the replay", "algorithm learner planner switch"),
    bind(A::Preset, "preset", &[], |s, _| s.open(lists::presets(s.screen.run().preset)))
        .about("change to the settings of a preset", "defaults paper tuned sb3 profile"),
];

const GOAL_AND_AGENT: &[Binding] = &[
    watch(A::NewGoal, "new-goal", &["n"], act_on_goal)
        .about("a random new goal (or click on the map)", "target destination next change set")
        .short("goal")
        .own(Comparison::new_goal)
        .in_present(),
    towards(A::Move(-1, 0), "left", &["left", "h"]).help("move the goal or cursor left"),
    towards(A::Move(0, 1), "down", &["down", "j"]).help("move the goal or cursor down").in_lists(),
    towards(A::Move(0, -1), "up", &["up", "k"]).help("move the goal or cursor up").in_lists(),
    towards(A::Move(1, 0), "right", &["right", "l"]).help("move the goal or cursor right"),
    watch_scene(A::NewStart, "new-start", &[])
        .about("put @ at a random place (right-click: at that cell)", "start agent walker")
        .own(Comparison::new_start)
        .in_present(),
    watch_scene(A::StartHere, "start-here", &["shift-s"])
        .about("put @ at the cursor or goal", "start agent walker position teleport")
        .own(Comparison::start_here)
        .in_present(),
    watch(A::GoalHere, "goal-here", &["enter"], act_on_goal)
        .about("put the goal at the cursor", "target set")
        .own(Comparison::move_goal)
        .in_present(),
    watch(A::OnArrival, "on-arrival", &["t"], |s, _| watching::next_on_arrival(s))
        .about("when @ arrives: restart, visit other goals, or stay", "tour loop repeat")
        .own(Comparison::next_on_arrival),
];

const fn towards(action: A, name: &'static str, keys: Keys) -> Binding {
    bind(action, name, keys, act_on_goal).own(Comparison::move_goal)
}

const VIEW: &[Binding] = &[
    watch(A::Field(true), "next-field", &["v"], |s, _| watching::next_field(s, true))
        .about("colour the map by the next quantity", "view field distance heatmap visits error")
        .short("view")
        .own(Comparison::next_field)
        .in_present(),
    watch(A::Field(false), "previous-field", &["shift-v"], |s, _| watching::next_field(s, false))
        .about("colour the map by the previous quantity", "view field distance heatmap back")
        .own(Comparison::next_field)
        .in_present(),
    overlay(Overlay::Contours, "contours", &["c"])
        .about("contour lines, on or off", "isolines levels overlay layer hide show"),
    overlay(Overlay::Unexplored, "unvisited", &["x"])
        .about("unvisited places and their edge, on or off", "unexplored exploration frontier fog"),
    overlay(Overlay::Agents, "agents", &["shift-a"])
        .about("exploring agents, trails, frontier goals, on or off", "explorers robots dots"),
    overlay(Overlay::Candidates, "candidates", &["b"])
        .about("bridge candidates, on or off (zoom in for more)", "bridges points nodes waypoints"),
    overlay(Overlay::Edges, "edges", &["g"])
        .about("edges of the bridge graph, on or off", "graph links lines overlay layer hide show"),
    overlay(Overlay::Search, "search", &["shift-b"])
        .about("the latest search for a bridge point, on or off", "bridge overlay layer"),
    overlay(Overlay::Path, "path", &["p"])
        .about("the path planned by @, on or off", "plan route waypoints overlay layer hide show"),
    overlay(Overlay::Ghost, "ghost", &["a"])
        .about("a, the actor alone from the same start, on or off", "ghost pale plan walker")
        .short("actor"),
    watch_scene(A::Inspect, "inspect", &["i"])
        .about("inspect cells with a cursor", "look value info cell query coordinates position")
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
    watch(A::Back, "back-in-time", &["["], |s, _| watching::step_through_film(s, false, None))
        .about("go back in time: what was learned by then", "past history film rewind earlier")
        .own(Comparison::step_through_film),
    watch(A::Forth, "forth-in-time", &["]"], |s, _| watching::step_through_film(s, true, None))
        .about("go forward in time, up to the present", "future now film later next travel movie")
        .own(Comparison::step_through_film),
    watch_scene(A::Projection, "projection", &["shift-p"])
        .about("choose the next projection", "side top front orbit rotate camera angle")
        .short("projection"),
    watch_scene(A::Alone, "alone", &["shift-z"])
        .about("show the chosen projection alone, or all", "single full"),
    watch(A::Marker, "marker", &[], |s, _| watching::change_marker(s))
        .about("pixels, half blocks or quadrants", "characters symbols resolution font")
        .each(),
    watch(A::Theme, "theme", &["shift-t"], |s, _| s.open(lists::themes(s.screen.theme.name)))
        .about("dark, light or colour-blind-safe", "themes colors color scheme mode palette black"),
];

const PANES: &[Binding] = &[
    pane(Pane::Training, "training", &["1"])
        .about("training progress and success", "statistics numbers pane panel"),
    pane(Pane::Curves, "curves", &["2"])
        .about("curves of success, exploration, losses and errors", "plots charts graphs history"),
    pane(Pane::Walk, "walk", &["3"]).about("the walking agent", "pane panel"),
    pane(Pane::Legend, "legend", &["4"])
        .about("legend of the map", "key meaning symbols overlays layers signs pane panel"),
    bind(A::NextPane, "next-pane", &["tab"], |s, _| watching::show_next(s))
        .about("select the next pane", "panel tab switch")
        .short("panes"),
    watch(A::Maximise, "maximise", &["z"], |s, _| s.screen.maximised = !s.screen.maximised)
        .about("maximise or restore the pane", "maximize full screen fullscreen enlarge large"),
    watch(A::Messages, "messages", &["shift-m"], |s, _| {
        match lists::messages(s.screen.log.entries()) {
            Some(list) => s.open(list),
            None => s.screen.say("no messages yet"),
        }
    })
    .about("all messages of this run, the latest first", "log events history notices errors"),
];

const MAP_EDITOR: &[Binding] = &[
    edit(A::ToggleEdit, "edit", &["e"])
        .about("open or close the editor", "draw walls change create map modify doors")
        .short("edit"),
    tool(A::Tool(Tool::Pencil), "pencil", &["1"])
        .about("draw walls (drag; right-drag: floor)", "block obstacle"),
    tool(A::Tool(Tool::Eraser), "eraser", &["2"]).about("draw floor", "erase remove delete wall"),
    tool(A::Tool(Tool::Line), "line", &["3"]).help("draw a straight wall"),
    tool(A::Tool(Tool::Rectangle), "rectangle", &["4"])
        .about("draw walls around a rectangle", "box room"),
    tool(A::Tool(Tool::Fill), "fill", &["5"])
        .about("fill an area with wall, or a wall with floor", "bucket flood"),
    tool(A::Tool(Tool::Start), "start", &["6"]).help("add or remove a start S"),
    tool(A::Tool(Tool::Goal), "goal", &["7"]).help("add or remove a goal G"),
    tool(A::Apply, "apply", &["enter"]).help("use the tool at the cursor; twice for a line"),
    edit(A::Undo, "undo", &["u"]).about("undo an edit", "revert back"),
    edit(A::Redo, "redo", &["ctrl-r"]).about("redo an edit", "repeat again"),
    scene(A::SaveMap, "save-map", &["ctrl-w"])
        .about("save the map to a file", "write export store world")
        .first(),
    bind(A::OpenMap, "open-map", &["shift-o"], |s, _| disk::pick_map(s, None))
        .about("open another map", "load file choose switch world random empty new create arm"),
];

const FILES: &[Binding] = &[
    watch(A::Save, "save", &["s"], |s, _| _ = s.saver.save(&mut s.cx))
        .about("save a checkpoint", "store write keep networks model weights")
        .short("save")
        .each(),
    bind(A::SaveAs, "save-as", &[], |s, _| s.open(s.saver.ask_file("name of the checkpoint")))
        .about("save a checkpoint under a name", "store write copy rename"),
    bind(A::TrainCopy, "train-copy", &["shift-c"], |s, _| s.ask_for_copy())
        .within(Mode::Elsewhere)
        .about("train a copy of the run that another program trains", "fork continue resume own")
        .short("train a copy"),
    watch(A::Load, "load", &["shift-l"], |s, _| disk::pick_checkpoint(s))
        .about("load a checkpoint", "open restore read resume run model weights"),
    watch(A::Export, "export", &["shift-e"], |s, _| {
        s.open(lists::exports(&ExportKind::ALL, s.scene.noun()));
    })
    .about("export map or curves", "screenshot picture image png svg csv figure capture print")
    .first(),
];

const PROGRAM: &[Binding] = &[
    bind(A::NextTourStep, "next-step", &["enter"], |s, _| s.guide.next_step(&mut s.cx))
        .help("next step of the tour (or click)")
        .within(Mode::Touring),
    bind(A::EndTour, "end-tour", &["esc"], |s, _| s.guide.end(&mut s.cx))
        .help("end the tour")
        .within(Mode::Touring),
    bind(A::Help, "help", &["?", ":", "f1", "ctrl-p"], |s, _| {
        s.screen.explains = false;
        s.open(lists::help(&s.screen, &s.scene));
    })
    .about("this help: all actions, settings and numbers", "keys command search manual bindings")
    .short("help")
    .own(Comparison::open_help)
    .in_lists(),
    bind(A::Close, "close", &["esc"], |s, _| watching::close_top(s))
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
        .about("quit", "exit leave close end bye")
        .short("quit")
        .own(Comparison::quit)
        .in_lists(),
];

const COMPARISON: &[Binding] = &[bind(A::Axis, "axis", &[], |_, _| {})
    .within(Mode::Comparing)
    .own(|comparison, _| comparison.axis = comparison.axis.next())
    .help(OVER)];

/// What the curves of comparisons and lists are drawn over.
const OVER: &str = "curves over updates, environment steps or seconds (or click on their title)";

const RUNS: &[Binding] = &[
    on_runs(ListAction::Mark, "mark-run", &["m"]).short("mark").help(
        "mark the selected run, or unmark it (or click on it twice): marked runs are drawn together",
    ),
    on_runs(ListAction::Filter, "filter-runs", &["/"]).short("filter").help(
        "list only runs with all of the words typed: of map, method, settings and file; \
         seed=1 or hidden=64 must be equal",
    ),
    on_runs(ListAction::Open, "open-run", &["enter"]).short("open").help(
        "open the selected run, paused as it was saved, or watch it while another program trains it; \
         of two marked runs, show both side by side",
    ),
    on_runs(ListAction::Measure, "runs-curves", &["v"]).short("view").help(
        "curves of the next quantity: success, alone, error of D, explored",
    ),
    on_runs(ListAction::Axis, "runs-axis", &[])
        .help(OVER),
    on_runs(ListAction::Sort(true), "sort-runs", &["right", "l"])
        .short("sort")
        .help("sort by the next column (or click on its name; again reverses)"),
    on_runs(ListAction::Sort(false), "sort-runs-back", &["left", "h"])
        .help("sort by the column before"),
    on_runs(ListAction::Reverse, "reverse-runs", &["r"]).help("reverse the order"),
    on_runs(ListAction::Delete, "delete-runs", &["delete", "shift-d"])
        .help("delete the files of the marked runs, or of the selected one; asks first"),
    on_runs(ListAction::Page(-1), "runs-page-up", &["pageup"]).help("a page up"),
    on_runs(ListAction::Page(1), "runs-page-down", &["pagedown"]).help("a page down"),
    on_runs(ListAction::Select(0), "first-run", &["home"]).help("the first run"),
    on_runs(ListAction::Select(usize::MAX), "last-run", &["end"]).help("the last run"),
];
