//! Why a comparison does not have some of the actions that a single run has.

use crate::tui::action::Action;

/// Returns why an action is not available, and what to do instead.
pub fn reason(action: Action) -> &'static str {
    use Action as A;
    match action {
        A::Save | A::SaveAs | A::Load | A::Resume | A::Autosave => {
            "it saves and loads nothing: gdg-tui MAP --method METHOD trains a run that is saved"
        }
        A::Settings | A::ResetSetting | A::Preset | A::Method | A::NewSeed => {
            "methods, settings and seed are chosen at the start: gdg-tui compare --help"
        }
        A::OpenMap | A::RandomMap | A::NewMap | A::ResizeMap => {
            "both stay on their map, which can be edited; gdg-tui compare A B MAP begins on another"
        }
        A::LayUnder => "gdg-tui runs lays the curves of more runs over each other",
        A::Faster | A::Slower => "each side trains as fast as it can",
        A::Follow => "both sides show the walking agents @",
        A::Show(_) | A::NextPane | A::Maximise | A::Scroll(_) | A::LogScale => {
            "facts and curves are always shown, there are no panes"
        }
        A::ExportFilm => "gdg-tui film makes the film of a saved run",
        A::Tour | A::Compare | A::NextTourStep | A::EndTour => {
            "quit first, then start it in a shell"
        }
        A::Theme => "the theme is chosen in the configuration: gdg-tui --print-config-template",
        _ => "only single runs have it",
    }
}
