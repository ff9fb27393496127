//! Learning settings; each can be set on its own.

use serde::{Deserialize, Serialize};

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

/// What computes updates. All give the same results up to rounding; only the first is
/// multithreaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Backend {
    /// Hand-written kernels on the CPU, without a tape.
    Fused,
    /// Candle's tape on the CPU, with each MLP as one operation.
    Tape,
}

/// A setting that follows from what the run has seen, unless it is given. In JSON, `"auto"` or the
/// value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Auto<T> {
    /// The given value.
    Given(T),
    /// Follows from the run.
    Auto(AutoWord),
}

/// The word that stands for an automatic setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AutoWord {
    /// `"auto"`.
    Auto,
}

impl<T: Copy> Auto<T> {
    /// The automatic setting.
    pub const AUTO: Self = Self::Auto(AutoWord::Auto);

    /// Returns the given value, if it is not automatic.
    pub fn given(self) -> Option<T> {
        match self {
            Self::Given(value) => Some(value),
            Self::Auto(_) => None,
        }
    }
}

/// A setting whose value is out of range, by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the setting {0} is out of range")]
pub struct OutOfRange(pub &'static str);

/// Settings of networks, losses and batches. Defaults are the preset `default`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearnSettings {
    /// Width of each hidden layer.
    pub hidden: usize,
    /// Number of hidden layers (ReLU).
    pub layers: usize,
    /// Adam's step size for the networks.
    pub learning_rate: f32,
    /// Polyak factor: averages move by tau towards the current weights at every update.
    pub tau: f32,
    /// Pairs (and transitions) in a batch.
    #[serde(alias = "batch")]
    pub batch_size: usize,
    /// Number of critics, which are combined as `pessimism` says.
    pub critics: usize,
    /// Weight of the largest of the critics' distances in D, from 0 to 1; the rest is their mean.
    /// The maximum (Fujimoto et al. 2018, clipped double Q) guards against shortcuts that are not
    /// there, but errors add up to far distances that are too long; those of the mean are too
    /// short.
    #[serde(default = "maximum")]
    pub pessimism: f32,
    /// Steps after which a target bootstraps from the target critic; 1 as in Algorithm 1.
    pub n_step: usize,
    /// Weight of a critic's squared error where the target is below D, and 1 minus the weight where
    /// it is above. 0.5 is the plain squared error.
    pub expectile: f32,
    /// Whether targets are capped at the actor's one-step lookahead, 1 + D'(f(s, mu'(s, g)), g). D
    /// is then the distance of the better of behaviour and actor, as in generalised policy
    /// iteration (Sutton and Barto 2018, section 4.6), whereas the behaviour alone (Algorithm 1)
    /// makes detours. An expectile of 0.95 also corrects for detours, but makes distances that are
    /// too short hardly grow.
    pub greedy_targets: bool,
    /// Whether a pair whose own step the dynamics model mispredicts is left out of
    /// `greedy_targets`: where the model takes a wall for open ground, the lookahead makes D too
    /// short.
    #[serde(default)]
    pub model_check: bool,
    /// Updates after an edit during which distances that have changed are relearned: those that are
    /// far longer or shorter along the bridge graph are bounded by it, the dynamics model sees more
    /// recent transitions (it has yet to learn that new walls block the path), and a stuck actor is
    /// freed. Without a graph, targets follow the behaviour alone, over many steps, which all
    /// distances suffer from.
    pub relearn_updates: u64,
    /// Whether a goal that was reached j steps later bounds the target by j.
    pub hindsight_bound: bool,
    /// Upper bound of D's targets, in steps; 0 for none. Without discount, D of goals that are
    /// never reached grows without end (Eq. 5); SoRB's distributional critic is bounded in the same
    /// way by its largest bin.
    #[serde(default)]
    pub max_distance_steps: f32,
    /// Share of a batch whose goals are states reached later in the same episode.
    pub goal_hindsight: f32,
    /// Share of the hindsight goals whose steps ahead are drawn from a geometric distribution (the
    /// rest uniformly from the future).
    pub goal_geometric: f32,
    /// Mean of that geometric distribution, in steps.
    pub goal_geometric_mean_steps: f32,
    /// Share of a batch whose goals are random states of the replay; the rest keep the goals that
    /// were pursued.
    pub goal_random: f32,
    /// Scale on which a critic's error is measured.
    pub loss: LossScale,
    /// D = scale * softplus(network output), in steps.
    pub distance_scale_steps: f32,
    /// Actions are tanh(z); |z| above this bound is penalised, as a saturated actor has no gradient
    /// left to learn from. 0 for no bound.
    pub actor_bound: f32,
    /// Fourier features sin, cos(pi 2^l u) of positions u in [-1, 1], for l = 0 .. octaves - 1.
    pub fourier_octaves: usize,
    /// Scales c of the relative inputs tanh((g - s) / c), in goal radii (cells of a maze); empty
    /// for none.
    pub relative_scales: Vec<f32>,
    /// Cell sizes of the trainable grid encoding, in goal radii; empty for none. Only for
    /// environments whose goals are positions.
    pub grid_cells: Vec<f32>,
    /// Trainable numbers at each corner of each grid.
    pub grid_channels: usize,
    /// Adam's step size for the grid encoding.
    pub grid_learning_rate: f32,
    /// Share of a batch that consists of pairs of bridge candidates whose targets are bounded by
    /// their graph distance, once there is a graph.
    pub distillation: f32,
    /// Whether the targets of all far pairs are bounded by paths through the bridge graph, once
    /// there is one.
    #[serde(default)]
    pub graph_bounds: bool,
    /// Whether the actor is led by waypoints on paths through the bridge graph, once there is one.
    #[serde(default)]
    pub actor_waypoints: bool,
    /// Whether the actor is pulled towards what lookahead finds where its own action changes
    /// nothing: there, the gradient of Algorithm 1 vanishes.
    #[serde(default)]
    pub unblock_actor: bool,
    /// Number of transitions kept for replay.
    #[serde(alias = "replay_capacity")]
    pub buffer_size: usize,
    /// Discount gamma of learners with rewards (`ddpg`, `her`, `ddpg-distance`), at least 0 and
    /// below 1. With 0, `ddpg-distance` has the paper's V(s, g) = -|s - g| (section 4.1); sparse
    /// rewards need more than 0.
    #[serde(default = "default_discount")]
    pub discount: f32,
    /// Weight of the actor's squared outputs before tanh in the loss of learners with rewards
    /// (Andrychowicz et al. 2017, appendix A).
    #[serde(default)]
    pub actor_l2: f32,
    /// Standard deviation of the noise on the actions of targets, for learners with rewards
    /// (Fujimoto et al. 2018, section 5.3).
    #[serde(default)]
    pub target_noise: f32,
    /// What computes updates.
    pub backend: Backend,
}

/// The discount in checkpoints from before there was one.
fn default_discount() -> f32 {
    LearnSettings::default().discount
}

/// The pessimism in checkpoints from before it was a setting.
fn maximum() -> f32 {
    1.0
}

impl Default for LearnSettings {
    fn default() -> Self {
        Self {
            hidden: 128,
            layers: 2,
            learning_rate: 1e-3,
            tau: 0.005,
            batch_size: 64,
            critics: 2,
            pessimism: 1.0,
            n_step: 3,
            expectile: 0.55,
            greedy_targets: true,
            model_check: true,
            relearn_updates: 3_000,
            hindsight_bound: true,
            max_distance_steps: 0.0,
            goal_hindsight: 0.5,
            goal_geometric: 0.5,
            goal_geometric_mean_steps: 25.0,
            goal_random: 0.1,
            loss: LossScale::Sqrt,
            distance_scale_steps: 40.0,
            actor_bound: 2.5,
            fourier_octaves: 3,
            relative_scales: vec![0.5, 1.0, 2.0, 4.0, 8.0, 32.0],
            grid_cells: vec![4.0, 2.0, 1.0, 0.5],
            grid_channels: 4,
            grid_learning_rate: 5e-3,
            distillation: 0.3,
            graph_bounds: true,
            actor_waypoints: true,
            unblock_actor: true,
            buffer_size: 1_000_000,
            discount: 0.99,
            actor_l2: 0.0,
            target_noise: 0.0,
            backend: Backend::Fused,
        }
    }
}

impl LearnSettings {
    /// Returns the preset `paper`: Algorithm 1 without any of the additions.
    pub fn paper() -> Self {
        Self {
            critics: 1,
            n_step: 1,
            tau: 0.01,
            expectile: 0.5,
            greedy_targets: false,
            model_check: false,
            relearn_updates: 0,
            hindsight_bound: false,
            max_distance_steps: 20.0,
            goal_hindsight: 0.0,
            goal_random: 0.0,
            loss: LossScale::Squared,
            actor_bound: 0.0,
            fourier_octaves: 0,
            relative_scales: Vec::new(),
            grid_cells: Vec::new(),
            distillation: 0.0,
            graph_bounds: false,
            actor_waypoints: false,
            unblock_actor: false,
            ..Self::default()
        }
    }

    /// Returns the preset `tuned`: learners with rewards as published, in the setting in which they
    /// do best here.
    pub fn tuned() -> Self {
        Self {
            batch_size: 256,
            model_check: false,
            goal_hindsight: 0.8,
            goal_geometric: 0.0,
            goal_random: 0.0,
            fourier_octaves: 0,
            relative_scales: Vec::new(),
            grid_cells: Vec::new(),
            distillation: 0.0,
            graph_bounds: false,
            actor_waypoints: false,
            unblock_actor: false,
            ..Self::default()
        }
    }

    /// Returns the preset `sb3`: the defaults of Stable-Baselines3's DDPG and hindsight replay,
    /// with two hidden layers of one width.
    pub fn sb3() -> Self {
        Self { hidden: 256, critics: 1, actor_bound: 0.0, ..Self::tuned() }
    }

    /// Checks every value's range.
    ///
    /// # Errors
    /// Returns the first setting that is out of range.
    pub fn validate(&self) -> Result<(), OutOfRange> {
        let share = |v: f32| (0.0..=1.0).contains(&v);
        let positive = |v: f32| v > 0.0 && v.is_finite();
        let scales = |v: &[f32]| v.len() <= 16 && v.iter().all(|c| (0.01..=1e6).contains(c));
        let checks = [
            ("hidden", (1..=4096).contains(&self.hidden)),
            ("layers", (1..=8).contains(&self.layers)),
            ("learning_rate", positive(self.learning_rate)),
            ("tau", self.tau > 0.0 && self.tau <= 1.0),
            ("batch_size", (1..=65_536).contains(&self.batch_size)),
            ("critics", (1..=2).contains(&self.critics)),
            ("pessimism", share(self.pessimism)),
            ("n_step", (1..=1000).contains(&self.n_step)),
            ("expectile", self.expectile > 0.0 && self.expectile < 1.0),
            ("max_distance_steps", (0.0..=1e6).contains(&self.max_distance_steps)),
            ("goal_hindsight", share(self.goal_hindsight)),
            ("goal_geometric", share(self.goal_geometric)),
            ("goal_geometric_mean_steps", (1.0..=1e6).contains(&self.goal_geometric_mean_steps)),
            (
                "goal_random",
                share(self.goal_random) && self.goal_random + self.goal_hindsight <= 1.0,
            ),
            ("distance_scale_steps", positive(self.distance_scale_steps)),
            ("actor_bound", (0.0..=100.0).contains(&self.actor_bound)),
            ("fourier_octaves", self.fourier_octaves <= 12),
            ("relative_scales", scales(&self.relative_scales)),
            ("grid_cells", scales(&self.grid_cells)),
            ("grid_channels", (1..=32).contains(&self.grid_channels)),
            ("grid_learning_rate", positive(self.grid_learning_rate)),
            ("distillation", share(self.distillation)),
            ("discount", (0.0..1.0).contains(&self.discount)),
            ("target_noise", (0.0..=100.0).contains(&self.target_noise)),
            ("actor_l2", (0.0..=1e6).contains(&self.actor_l2)),
            ("buffer_size", (1_000..=100_000_000).contains(&self.buffer_size)),
        ];
        checks.iter().find(|(_, ok)| !ok).map_or(Ok(()), |(name, _)| Err(OutOfRange(name)))
    }
}
