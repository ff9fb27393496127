//! The table of all actions.

use super::{Action, Binding, ListAction, Section, When};
use crate::tui::layers::Overlay;
use crate::tui::panes::Pane;
use crate::tui::tool::Tool;

const fn bind(
    action: Action,
    name: &'static str,
    keys: &'static [&'static str],
    long: &'static str,
) -> Binding {
    Binding { action, name, when: When::Always, keys, short: "", long, words: "" }
}

impl Binding {
    /// Makes the binding active only while the editor is open.
    const fn editing(self) -> Self {
        Self { when: When::Editing, ..self }
    }

    /// Makes the binding active only while the editor is closed.
    const fn watching(self) -> Self {
        Self { when: When::Watching, ..self }
    }

    /// Makes the binding active only in one place.
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
}

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
    bind(Action::TogglePause, "pause", &["space"], "pause or resume training")
        .short("pause")
        .also("stop halt continue unpause play start run go wait"),
    bind(Action::StepUpdate, "step-update", &["."], "run one update, then pause")
        .also("single step advance gradient"),
    bind(Action::StepEpisode, "step-episode", &[","], "train until an episode ends, then pause")
        .also("next step advance"),
    bind(Action::Faster, "faster", &[">"], "more updates per second")
        .also("speed fast quick rate limit unlimited accelerate max maximum forward"),
    bind(Action::Slower, "slower", &["<"], "fewer updates per second")
        .also("speed slow down rate limit throttle"),
    bind(Action::Freeze, "freeze", &["shift-f"], "freeze the screen while training continues")
        .watching()
        .also("still hold lock display"),
    bind(
        Action::Evaluate,
        "evaluate",
        &["y"],
        "evaluate now: how many test walks reach their goals",
    )
    .also("evaluation test measure score success rate benchmark accuracy performance"),
    bind(Action::NewSeed, "new-seed", &["shift-r"], "restart with another seed")
        .watching()
        .also("reset again scratch random number new run start over"),
    bind(Action::Settings, "settings", &["o"], "change a setting during training").watching().also(
        "options preferences parameters hyperparameters configuration configure \
             learning rate batch size gamma discount lr bigger network width hidden \
             layers neurons units noise epsilon optimizer episode length number agents \
             parallel",
    ),
    bind(
        Action::ResetSetting,
        "reset-setting",
        &["delete", "ctrl-x"],
        "reset the selected setting",
    )
    .within(When::Settings),
    bind(Action::Method, "method", &[], "change to another method, keeping the data").also(
        "algorithm learner planner switch gdg gdg-bridge her ddpg sorb rival baseline \
             reward",
    ),
    bind(Action::Preset, "preset", &[], "change to the settings of a preset")
        .also("defaults paper tuned sb3 profile"),
];

const GOAL_AND_AGENT: &[Binding] = &[
    bind(Action::NewGoal, "new-goal", &["n"], "a random new goal (or click on the map)")
        .short("goal")
        .watching()
        .also("target destination next change set"),
    bind(Action::Move(-1, 0), "left", &["left", "h"], "move the goal or cursor left"),
    bind(Action::Move(0, 1), "down", &["down", "j"], "move the goal or cursor down"),
    bind(Action::Move(0, -1), "up", &["up", "k"], "move the goal or cursor up"),
    bind(Action::Move(1, 0), "right", &["right", "l"], "move the goal or cursor right"),
    bind(
        Action::NewStart,
        "new-start",
        &["w"],
        "put @ at a random place (right-click: at that cell)",
    )
    .watching()
    .also("start agent walker position move teleport spawn"),
    bind(Action::StartHere, "start-here", &["shift-s"], "put @ at the cursor or goal")
        .watching()
        .also("start agent walker position teleport"),
    bind(Action::GoalHere, "goal-here", &["enter"], "put the goal at the cursor")
        .watching()
        .also("target set"),
    bind(
        Action::OnArrival,
        "on-arrival",
        &["t"],
        "when @ arrives: restart, visit other goals, or stay",
    )
    .watching()
    .also("tour loop repeat"),
    bind(Action::Follow, "follow", &["f"], "follow the next exploring agent")
        .watching()
        .also("track watch explorer rollout trajectory episode"),
];

const VIEW: &[Binding] = &[
    bind(Action::Field(true), "next-field", &["v"], "colour the map by the next quantity")
        .short("view")
        .watching()
        .also("view field distance heatmap visits error truth value function layer mode"),
    bind(
        Action::Field(false),
        "previous-field",
        &["shift-v"],
        "colour the map by the previous quantity",
    )
    .watching()
    .also("view field distance heatmap back"),
    bind(Action::Toggle(Overlay::Contours), "contours", &["c"], "contour lines, on or off")
        .watching()
        .also("isolines levels overlay layer hide show"),
    bind(
        Action::Toggle(Overlay::Directions),
        "directions",
        &["r"],
        "the actor's directions, on or off",
    )
    .watching()
    .also("arrows policy actions gradient vector field quiver overlay layer hide show"),
    bind(
        Action::Toggle(Overlay::Unexplored),
        "unvisited",
        &["x"],
        "unvisited cells and their edge, on or off",
    )
    .watching()
    .also("unexplored exploration frontier fog coverage overlay layer hide show"),
    bind(
        Action::Toggle(Overlay::Agents),
        "agents",
        &["a"],
        "exploring agents, trails, frontier goals, on or off",
    )
    .watching()
    .also("explorers robots dots overlay layer hide show"),
    bind(
        Action::Toggle(Overlay::Candidates),
        "candidates",
        &["b"],
        "bridge candidates, on or off (zoom in for more)",
    )
    .watching()
    .also("bridges points nodes waypoints overlay layer hide show"),
    bind(Action::Toggle(Overlay::Edges), "edges", &["d"], "edges of the bridge graph, on or off")
        .watching()
        .also("graph links lines overlay layer hide show"),
    bind(
        Action::Toggle(Overlay::Search),
        "search",
        &["shift-b"],
        "the latest search for a bridge point, on or off",
    )
    .watching()
    .also("bridge overlay layer"),
    bind(Action::Toggle(Overlay::Path), "path", &["p"], "the path planned by @, on or off")
        .watching()
        .also("plan route waypoints overlay layer hide show"),
    bind(Action::Inspect, "inspect", &["i"], "inspect cells with a cursor")
        .watching()
        .also("cursor look value info cell query coordinates position hover"),
    bind(Action::ZoomIn, "zoom-in", &["+", "="], "zoom in (or mouse wheel)")
        .also("magnify larger bigger closer enlarge minimap"),
    bind(Action::ZoomOut, "zoom-out", &["-"], "zoom out").also("smaller farther shrink"),
    bind(Action::ZoomOff, "whole-map", &["0"], "show the whole map")
        .watching()
        .also("fit all reset zoom overview"),
    bind(Action::Pan(-1, 0), "pan-left", &["shift-left", "alt-left"], "pan the map to the left")
        .also("scroll"),
    bind(Action::Pan(1, 0), "pan-right", &["shift-right", "alt-right"], "pan the map to the right")
        .also("scroll"),
    bind(Action::Pan(0, -1), "pan-up", &["shift-up", "alt-up"], "pan the map upwards")
        .also("scroll"),
    bind(Action::Pan(0, 1), "pan-down", &["shift-down", "alt-down"], "pan the map downwards")
        .also("scroll"),
    bind(Action::Back, "back-in-time", &["["], "go back in time: what was learned by then")
        .watching()
        .also(
            "past history film rewind earlier previous before go time travel scrub movie \
             replay",
        ),
    bind(Action::Forth, "forth-in-time", &["]"], "go forward in time, up to the present")
        .watching()
        .also("future now present film forward later next time travel movie replay"),
    bind(Action::Projection, "projection", &["shift-p"], "choose the next projection")
        .short("projection")
        .watching()
        .also("side top front orbit rotate camera angle"),
    bind(Action::Alone, "alone", &["shift-z"], "show the chosen projection alone, or all")
        .watching()
        .also("single full"),
    bind(Action::Marker, "marker", &["m"], "pixels, half blocks, quadrants or braille")
        .watching()
        .also("characters symbols pixels resolution font"),
    bind(Action::Theme, "theme", &["shift-t"], "dark, light, colour-blind-safe, or no colours")
        .watching()
        .also("themes colors color scheme mode palette black white mono accessibility"),
];

const PANES: &[Binding] = &[
    bind(Action::Show(Pane::Training), "training", &["1"], "training progress and success")
        .watching()
        .also("statistics numbers pane panel"),
    bind(
        Action::Show(Pane::Curves),
        "curves",
        &["2"],
        "curves of success, coverage, losses and errors",
    )
    .watching()
    .also("plots charts graphs history loss td bellman error tensorboard pane panel"),
    bind(Action::Show(Pane::Walk), "walk", &["3"], "the followed agent")
        .watching()
        .also("pane panel"),
    bind(Action::Show(Pane::Legend), "legend", &["4"], "legend of the map")
        .watching()
        .also("key meaning symbols overlays layers signs pane panel"),
    bind(Action::Show(Pane::Log), "log", &["5"], "event log")
        .watching()
        .also("messages events history notices errors pane panel"),
    bind(Action::NextPane, "next-pane", &["tab"], "select the next pane")
        .short("panes")
        .also("panel tab switch"),
    bind(Action::Maximise, "maximise", &["z"], "maximise or restore the pane").watching().also(
        "maximize full screen fullscreen enlarge large pane panel sidebar explain \
             meaning",
    ),
    bind(Action::Scroll(-1), "scroll-back", &["pageup"], "scroll curves and log back")
        .also("page up earlier"),
    bind(Action::Scroll(1), "scroll-on", &["pagedown"], "scroll curves and log forward")
        .also("page down later"),
    bind(Action::LogScale, "log-scale", &["g"], "toggle logarithmic curves")
        .watching()
        .also("log axis linear"),
    bind(
        Action::LayUnder,
        "lay-under",
        &["shift-u"],
        "show a saved run's curves behind these, or remove them",
    )
    .watching()
    .also("compare yesterday earlier saved reference baseline overlay behind checkpoint"),
];

const MAP_EDITOR: &[Binding] = &[
    bind(Action::ToggleEdit, "edit", &["e"], "open or close the editor")
        .short("edit")
        .also("draw walls change map modify doors"),
    bind(Action::Tool(Tool::Pencil), "pencil", &["1"], "draw walls (drag; right-drag: floor)")
        .editing()
        .also("block obstacle"),
    bind(Action::Tool(Tool::Eraser), "eraser", &["2"], "draw floor")
        .editing()
        .also("erase remove delete wall"),
    bind(Action::Tool(Tool::Line), "line", &["3"], "draw a straight wall").editing(),
    bind(Action::Tool(Tool::Rectangle), "rectangle", &["4"], "draw walls around a rectangle")
        .editing()
        .also("box room"),
    bind(Action::Tool(Tool::Fill), "fill", &["5"], "fill an area with wall, or a wall with floor")
        .editing()
        .also("bucket flood"),
    bind(Action::Tool(Tool::Start), "start", &["6"], "add or remove a start S").editing(),
    bind(Action::Tool(Tool::Goal), "goal", &["7"], "add or remove a goal G").editing(),
    bind(Action::Apply, "apply", &["x", "enter"], "use the tool at the cursor; twice for a line")
        .editing(),
    bind(Action::Undo, "undo", &["u"], "undo an edit").also("revert back"),
    bind(Action::Redo, "redo", &["ctrl-r"], "redo an edit").also("repeat again"),
    bind(Action::NewMap, "new-map", &[], "create an empty map").also("blank clear world"),
    bind(Action::RandomMap, "random-map", &[], "open a random map")
        .also("generate maze city perfect labyrinth new world"),
    bind(Action::ResizeMap, "resize-map", &[], "resize the map")
        .also("size width height crop grow"),
    bind(Action::SaveMap, "save-map", &["ctrl-w"], "write the map to a file")
        .also("save export store world"),
    bind(Action::OpenMap, "open-map", &["shift-o"], "open another map").also(
        "load map file choose switch world fourrooms city trap arm robot fetch-reach \
             browse",
    ),
];

const FILES: &[Binding] = &[
    bind(Action::Save, "save", &["s"], "save a checkpoint")
        .short("save")
        .also("store write keep networks model weights"),
    bind(Action::SaveAs, "save-as", &[], "save a checkpoint under a name")
        .also("store write copy rename"),
    bind(Action::Load, "load", &["shift-l"], "load a checkpoint")
        .watching()
        .also("open restore read resume run model weights"),
    bind(Action::Resume, "resume", &["r"], "resume the saved run")
        .within(When::Offered)
        .also("continue load saved go on"),
    bind(Action::Autosave, "autosave", &[], "set the autosave interval")
        .also("automatic backup minutes"),
    bind(Action::Export, "export", &["shift-e"], "export map, curves, screen or film")
        .watching()
        .also("screenshot picture image png svg csv figure capture print data"),
    bind(Action::ExportFilm, "export-film", &[], "export the film of how distance was learned")
        .also(
            "animation animate apng gif video movie clip timelapse time lapse record \
             recording history",
        ),
];

const PROGRAM: &[Binding] = &[
    bind(Action::Tour, "guided-tour", &[], "take the guided tour of the four rooms").also(
        "tutorial demo introduction explain learn lesson beginner first steps teacher \
             student class",
    ),
    bind(Action::Compare, "compare", &[], "compare two methods side by side: how to start it")
        .also("comparison versus against race beside both rival baseline ablation"),
    bind(
        Action::NextTourStep,
        "next-step",
        &["enter", "right"],
        "next step of the tour (or click)",
    )
    .within(When::Touring),
    bind(Action::TogglePause, "pause-tour", &["p"], "pause or resume training and tour")
        .within(When::Touring),
    bind(Action::EndTour, "end-tour", &["esc"], "end the tour").within(When::Touring),
    bind(Action::Palette, "palette", &[":", "ctrl-p"], "find an action by name")
        .short("all")
        .also("command search"),
    bind(Action::Help, "help", &["?", "f1"], "show or hide this help")
        .short("help")
        .also("keys shortcuts manual documentation bindings usage about"),
    bind(Action::SearchHelp, "search-help", &["/"], "search the help").within(When::Help),
    bind(Action::Close, "close", &["esc"], "close the topmost dialog or mode")
        .also("cancel back escape"),
    bind(Action::Redraw, "redraw", &["ctrl-l"], "redraw the whole screen")
        .also("refresh repaint garbled again"),
    bind(Action::Suspend, "suspend", &["ctrl-z"], "suspend to the shell; fg resumes")
        .also("background"),
    bind(Action::Quit, "quit", &["q", "ctrl-c"], "quit")
        .short("quit")
        .also("exit leave close end bye"),
];

const COMPARISON: &[Binding] = &[
    bind(Action::Axis, "axis", &["g"], "curves over environment steps, seconds or updates")
        .short("axis")
        .within(When::Comparing),
    bind(Action::NextLarger, "next-larger", &["tab"], "left or right side larger, or both equal")
        .short("size")
        .within(When::Comparing),
    bind(Action::Larger(0), "left-larger", &["1"], "left side larger, or both equal")
        .within(When::Comparing),
    bind(Action::Larger(1), "right-larger", &["2"], "right side larger, or both equal")
        .within(When::Comparing),
];

const fn on_runs(
    action: ListAction,
    name: &'static str,
    keys: &'static [&'static str],
    long: &'static str,
) -> Binding {
    bind(Action::List(action), name, keys, long).within(When::Listing)
}

const RUNS: &[Binding] = &[
    on_runs(
        ListAction::Mark,
        "mark-run",
        &["space"],
        "mark the selected run, or unmark it (or click on it twice): marked runs are drawn together",
    )
    .short("mark"),
    on_runs(
        ListAction::Filter,
        "filter-runs",
        &["/"],
        "list only runs with all of the words typed: of map, method, settings and file; \
         seed=1 or hidden=64 must be equal",
    )
    .short("filter"),
    on_runs(ListAction::Resume, "resume-run", &["enter"], "resume the selected run")
        .short("resume"),
    on_runs(
        ListAction::Compare,
        "compare-runs",
        &["c"],
        "show side by side what two marked runs, or a marked and the selected one, have learned",
    )
    .short("compare"),
    on_runs(
        ListAction::Plot,
        "plot-runs",
        &["p"],
        "draw the marked runs as gdg-tui plot does: SVG and PDF, and the table behind them",
    )
    .short("plot"),
    on_runs(
        ListAction::Measure,
        "runs-curves",
        &["v"],
        "curves of success, success without plans, error of D, or what was explored",
    )
    .short("curves"),
    on_runs(
        ListAction::Axis,
        "runs-axis",
        &["x"],
        "curves over updates, environment steps or seconds",
    )
    .short("axis"),
    on_runs(
        ListAction::Sort,
        "sort-runs",
        &["s"],
        "sort by the next column (or click on its name; again reverses)",
    )
    .short("sort"),
    on_runs(ListAction::Reverse, "reverse-runs", &["shift-s"], "reverse the order"),
    on_runs(
        ListAction::Delete,
        "delete-runs",
        &["delete", "shift-d"],
        "delete the files of the marked runs, or of the selected one; asks first",
    ),
];
