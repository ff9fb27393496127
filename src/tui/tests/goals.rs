//! Spaces of goals: worlds that the program knows nothing about.

use super::*;
use crate::tui::choices::Pane;
use gdg::env::{FetchReach, GoalSpace, WorldScene};
use gdg::train::DataSource;
use gdg::viewer::View;

/// Returns an app in the space of an arm's goals, with a made-up view, drawn at the given size.
pub(super) fn staged_app(width: u16, height: u16) -> Still {
    let arm = FetchReach::new(0);
    let mut snapshot = Snapshot::clone(&still_in(&arm, Method::default()).screen.snapshot);
    snapshot.scene = WorldScene::Goals(Box::new(GoalSpace::of(&arm, None)));
    let mut app = still_at(snapshot);
    app.set_arm_goal([1.42, 0.83, 0.6]);
    // What is known of the space decides which part is shown.
    for _ in 0..2 {
        draw(&mut app, width, height);
        let view = View { pose: None, ..arm::staged_view(&app) };
        app.on_view(Arc::new(view));
    }
    app
}

#[test]
fn a_failure_of_the_environment_is_read_whole_on_a_small_screen() {
    let mut app = staged_app(80, 24);
    let cause = "PointMaze_UMaze-v3: its Python process has ended: killed by signal 9\n  one last \
                 line of the environment, which says what it did before it was killed";
    app.change_snapshot(|snapshot| {
        snapshot.phase = gdg::engine::Phase::Failed(cause.to_owned());
    });
    let shown = shown_by(&mut app, 80, 24);
    let words: Vec<&str> = shown.split(|c: char| c.is_whitespace() || c == '\u{2502}').collect();
    let words = words.into_iter().filter(|word| !word.is_empty()).collect::<Vec<_>>().join(" ");
    for part in ["killed by signal 9", "what it did before it was killed", "save and quit"] {
        assert!(words.contains(part), "{part:?} in\n{shown}");
    }
}

#[test]
fn a_run_that_learns_from_data_says_so_instead_of_agents() {
    let mut app = staged_app(120, 40);
    let source =
        DataSource { file: "a/walks.npz".into(), checksum: 7, transitions: 1_000_000, episodes: 5 };
    app.change_snapshot(|snapshot| {
        (snapshot.data, snapshot.agents) = (Some(Arc::new(source)), Arc::default());
    });
    app.act(Action::Show(Pane::Training));
    let shown = shown_by(&mut app, 120, 40);
    assert!(shown.contains("walks.npz") && shown.contains("1,000,000 recorded"), "{shown}");
}
