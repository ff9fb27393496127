//! What the colours of a side show where its learner has no D of its own, and what its preset is.

use gdg::train::{Preset, Registry, Run};

/// Texts about a side, the longer one first.
pub type Texts = [String; 2];

/// Explains a run's colours and its preset, as far as they are not those of the default method.
pub fn texts(run: &Run, registry: &Registry) -> Option<Texts> {
    let parts: Vec<[&str; 2]> =
        [colours(run, registry), preset(run.preset)].into_iter().flatten().collect();
    let joined = |i: usize| parts.iter().map(|part| part[i]).collect::<Vec<_>>().join("; ");
    (!parts.is_empty()).then(|| [joined(0), joined(1)])
}

/// What the help of a comparison begins with.
const INTRODUCTION: &str = "Two methods, A and B, train on the same map with the same seed. \
     Colours show the distance D that each has learned; @ walks to G with what it has learned so \
     far, in both from the same start. Click on either map to set the goal of both. The editor \
     draws walls and closes doors on both. Nothing is saved but pictures and maps; gdg-tui compare \
     --record FILE records the screen.";

/// Returns the text that begins the help, given the sides' titles and what is to be explained.
pub fn introduction(sides: [(&str, Option<&Texts>); 2]) -> String {
    let about = sides.into_iter().filter_map(|(title, texts)| {
        let [long, _] = texts?;
        Some(format!(" {title}: {long}."))
    });
    INTRODUCTION.to_owned() + &about.collect::<String>()
}

fn colours(run: &Run, registry: &Registry) -> Option<[&'static str; 2]> {
    match &*run.method.learner {
        "random" => Some(["D of networks that do not learn", "D of untrained networks"]),
        "gdg-distance" => Some(["D is given: the straight line to G", "D: the straight line"]),
        name if registry.learner(name).is_ok_and(|kind| kind.is_rewarded) => {
            Some(["it has no D: colours show the steps that its Q stands for", "D: steps by its Q"])
        }
        _ => None,
    }
}

fn preset(preset: Preset) -> Option<[&'static str; 2]> {
    match preset {
        Preset::Default => None,
        Preset::Paper => Some(["paper: exactly as published", "paper: as published"]),
        Preset::Tuned => {
            Some(["tuned: the settings with which it does best here", "tuned: best here"])
        }
        Preset::Sb3 => Some(["sb3: the defaults of Stable-Baselines3", "sb3: its defaults"]),
    }
}
