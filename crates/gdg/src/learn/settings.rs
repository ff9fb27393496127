//! Learning settings; each can be set on its own.

use serde::{Deserialize, Serialize};

use crate::settings::Effect::{NewAgents, NewNetworks};
use crate::settings::Preset::{Paper, Sb3, Tuned};
use crate::settings::{Excluded, Values, settings, without};

/// The scale on which a critic's error is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LossScale {
    /// Squared error of D itself, as in Algorithm 1.
    Squared,
    /// Squared error of sqrt(D + 1/4): relative accuracy near the goal, where steering happens.
    Sqrt,
    /// Squared error of ln(1 + D).
    Log,
}

settings! {
    /// Settings of networks, losses and batches.
    pub struct LearnSettings {
        networks {
            hidden: usize = 128, Sb3 => 256;
                "width of each hidden layer",
                usual: "Early, 32 costs the actor alone (four rooms 0.54, not 0.78); 256 brings \
                        little and takes longer.",
                values: Values::count(1, 4096), effect: NewNetworks;
            layers: usize = 2;
                "hidden layers (ReLU)",
                values: Values::count(1, 8), effect: NewNetworks;
            critics: usize = 2, Paper | Sb3 => 1;
                "number of critics; pessimism combines them",
                values: Values::count(1, 2), effect: NewNetworks,
                ablation: without("one critic", "1");
            distance_scale_steps: f32 = 40.0;
                "D = scale * softplus(output)",
                values: Values::POSITIVE, unit: "steps", effect: NewNetworks;
            fourier_octaves: usize = 3, Paper | Tuned | Sb3 => 0;
                "Fourier features sin, cos(pi 2^l u) of positions u, for l below this",
                values: Values::count(0, 12), effect: NewNetworks,
                ablation: without("no Fourier features", "0");
            relative_scales: Vec<f32> = vec![0.5, 1.0, 2.0, 4.0, 8.0, 32.0],
                Paper | Tuned | Sb3 => Vec::new();
                "scales c of the relative inputs tanh((g - s) / c); [] for none",
                values: Values::SCALES, unit: "goal radii", effect: NewNetworks,
                ablation: without("no relative inputs", "[]");
            grid_cells: Vec<f32> = vec![4.0, 2.0, 1.0, 0.5], Paper | Tuned | Sb3 => Vec::new();
                "cell sizes of the trainable grid encoding, for goals that are positions, in cells of \
                 the maze, or in goal radii without one; [] for none",
                values: Values::SCALES, unit: "maze cells", effect: NewNetworks,
                ablation: without("no grid encoding", "[]");
            actor_bound: f32 = 2.5, Paper | Sb3 => 0.0;
                "actions are tanh(z); |z| above this is penalised, as a saturated actor has no \
                 gradient; 0 for no bound",
                values: Values::number(0.0, 100.0),
                ablation: without("unbounded actor", "0");
            /// See Andrychowicz et al. 2017, appendix A.
            actor_l2: f32 = 0.0;
                "weight of the mean of z squared in the actor's loss of ddpg, her and \
                 ddpg-distance",
                values: Values::number(0.0, 1e6);
        }
        targets {
            n_step: usize = 3, Paper => 1;
                "n of the n-step return",
                usual: "Early, 1, 3 and 10 do equally well (four rooms: alone 0.81 0.78 0.87).",
                values: Values::count(1, 1000), unit: "steps",
                ablation: without("1-step targets", "1");
            /// The larger distance (Fujimoto et al. 2018, clipped double Q) guards against
            /// shortcuts that are not there, but its errors add up to far distances that are too
            /// long; those of the mean are too short.
            pessimism: f32 = 1.0;
                "weight of the larger distance of two critics in D; the rest is their mean",
                values: Values::FRACTION;
            expectile: f32 = 0.55, Paper => 0.5;
                "weight of errors where the target is below D, 1 minus it above; 0.5 is the \
                 squared error",
                values: Values::unit(Excluded::Both);
            /// D is then the distance of the better of behaviour and actor, as in generalised
            /// policy iteration (Sutton and Barto 2018, section 4.6); the behaviour alone
            /// (Algorithm 1) makes detours. An expectile of 0.95 also corrects for detours, but
            /// distances that are too short then hardly grow.
            greedy_targets: bool = true, Paper => false;
                "cap targets at the actor's one-step lookahead, 1 + D'(f(s, mu'(s, g)), g)",
                ablation: without("targets from behaviour alone", "false");
            /// Where the model takes a wall for open ground, the lookahead makes D too short.
            model_check: bool = true, Paper | Tuned | Sb3 => false;
                "leave pairs out of greedy_targets whose own step the dynamics model mispredicts; \
                        they raise no distance",
                ablation: without("no check of the model before targets", "false");
            hindsight_bound: bool = true, Paper => false;
                "cap targets at the steps in which a trajectory reached the goal",
                ablation: without("no hindsight bound", "false");
            graph_bounds: bool = true, Paper | Tuned | Sb3 => false;
                "cap targets of far pairs at the length of a path through the bridge graph",
                ablation: without("no bounds by the graph on other pairs", "false");
            actor_waypoints: bool = true, Paper | Tuned | Sb3 => false;
                "lead the actor to far goals by the next waypoint on the path through the bridge \
                 graph, unless places differ in more than the goal",
                ablation: without("no waypoints for the actor", "false");
            /// Where its own action changes nothing, the gradient of Algorithm 1 vanishes.
            unblock_actor: bool = true, Paper | Tuned | Sb3 => false;
                "pull the actor towards what lookahead finds where its own action changes nothing",
                ablation: without("no ways out for a blocked actor", "false");
            /// Without discount, D of goals that are never reached grows without end (Eq. 5);
            /// SoRB's distributional critic is bounded in the same way by its largest bin.
            max_distance_steps: f32 = 0.0, Paper => 20.0;
                "upper bound of targets; 0 for none but, where there are contacts, twice the time limit",
                values: Values::number(0.0, 1e6), unit: "steps";
            /// Distances that are far longer or shorter along the bridge graph are bounded by it,
            /// the dynamics model sees more recent transitions (it has yet to learn that new walls
            /// block the path), and a stuck actor is freed. Without a graph, targets follow the
            /// behaviour alone, over many steps, which degrades all distances.
            relearn_updates: u64 = 3_000, Paper => 0;
                "updates after an edit during which distances that have changed are relearned",
                values: Values::count(0, u64::MAX), unit: "updates";
            /// With 0, `ddpg-distance` has the paper's V(s, g) = -|s - g| (section 4.1); sparse
            /// rewards need more than 0.
            discount: f32 = 0.99;
                "discount gamma of the learners with rewards: ddpg, her and ddpg-distance",
                values: Values::unit(Excluded::Upper), effect: NewNetworks;
            /// See Fujimoto et al. 2018, section 5.3.
            target_noise: f32 = 0.0;
                "standard deviation of the noise on the actions of targets of ddpg, her and \
                 ddpg-distance",
                values: Values::number(0.0, 100.0);
            loss: LossScale = LossScale::Sqrt, Paper => LossScale::Squared;
                "scale on which the critic error is measured",
                values: Values::word(&["squared", "sqrt", "log"]),
                ablation: without("squared error of D", "squared");
            tau: f32 = 0.005, Paper => 0.01;
                "Polyak factor of target networks and averages",
                values: Values::unit(Excluded::Lower);
        }
        batches {
            batch_size: usize = 64, Tuned | Sb3 => 256;
                "pairs, and transitions, per batch",
                usual: "Early, 32, 64 and 256 do equally well (four rooms: alone 0.76 0.78 0.86); \
                        256 takes longer.",
                values: Values::count(1, 65_536), unit: "pairs";
            goal_hindsight: f32 = 0.5, Paper => 0.0, Tuned | Sb3 => 0.8;
                "fraction of goals relabelled in hindsight: states reached later in the episode",
                usual: "Early, 0 costs most (four rooms planned 0.87, not 1.00; city 0.76, not \
                        0.95); 0.9 does as well as 0.5.",
                values: Values::FRACTION;
            goal_geometric: f32 = 0.5, Tuned | Sb3 => 0.0;
                "fraction of hindsight goals a geometric number of steps ahead; the rest are \
                 uniform over the future",
                values: Values::FRACTION;
            goal_random: f32 = 0.1, Paper | Tuned | Sb3 => 0.0;
                "fraction of goals that are random states of the replay buffer; the rest are the \
                 goals pursued",
                values: Values::FRACTION.with("at most 1 together with goal_hindsight"),
                ablation: without("no random goals in a batch", "0");
            distillation: f32 = 0.3, Paper | Tuned | Sb3 => 0.0;
                "fraction of pairs that are bridge candidates, whose distance in the graph bounds \
                 the target",
                values: Values::FRACTION,
                ablation: without("no distillation", "0");
            /// Across thin walls D is too short, and the actor gets stuck in front of them.
            short_pairs: f32 = 0.5, Paper | Tuned | Sb3 => 0.0;
                "fraction of the pairs of distillation that are chosen of near ones, where D falls \
                 furthest short of the graph",
                values: Values::FRACTION,
                ablation: without("no pairs where D falls short", "0");
            /// The actor's walks end where it gets stuck; agents that explore are rarely there.
            imagined_walks: f32 = 0.125, Paper | Tuned | Sb3 => 0.0;
                "fraction of pairs from which, once there is a bridge graph, the dynamics model \
                 imagines the actor's walk, in every other batch; where that comes to rest, the \
                 pair begins",
                values: Values::FRACTION,
                ablation: without("no pairs where the actor gets stuck", "0");
            buffer_size: usize = 1_000_000;
                "capacity of the replay buffer",
                values: Values::count(1_000, 100_000_000)
                    .with("with room for an episode of every agent"),
                unit: "transitions", effect: NewAgents;
        }
        optimiser {
            learning_rate: f32 = 1e-3;
                "Adam's learning rate for the networks",
                usual: "Early, more is better: actor alone 0.52 0.78 0.91 on the four rooms with \
                        0.0003, 0.001, 0.003; city 0.15 0.20 0.38.",
                values: Values::POSITIVE;
            grid_learning_rate: f32 = 5e-3;
                "Adam's learning rate for the grid encoding",
                values: Values::POSITIVE;
        }
    }
}
