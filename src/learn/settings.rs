//! What can be set about learning, each piece on its own.

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

/// What computes updates. All do the same but for rounding; only the first one shares the work among threads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Backend {
    /// Kernels of our own on the CPU, without a tape.
    Fused,
    /// Candle's tape on the CPU, each perceptron one operation on it.
    Tape,
    /// Candle's tape and layers on the first CUDA device, in a program built with `--features cuda`.
    Cuda,
}

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
    pub batch: usize,
    /// Number of critics; their maximum counts (pessimism about short cuts).
    pub critics: usize,
    /// Steps after which a target bootstraps from the target critic; 1 as in Algorithm 1.
    pub n_step: usize,
    /// Weight of a critic's error where the target lies below D; 1 minus it where above. 0.5 is the plain square.
    pub expectile: f32,
    /// Whether a target is no longer than a step of the actor and what follows, 1 + D'(f(s, mu'(s, g)), g): what is
    /// learned is then the distance of the better of behaviour and actor, as in generalised policy iteration (Sutton
    /// and Barto 2018, section 4.6), where behaviour alone (Algorithm 1) strays. An expectile of 0.95 makes up for
    /// straying too, but with it distances that are too short hardly grow.
    pub greedy_targets: bool,
    /// Updates after walls went up during which targets go by behaviour alone, many steps at a time: distances have grown,
    /// and the dynamics model has yet to learn that there is no way through.
    pub relearn_updates: u64,
    /// Whether a goal known to have been reached j steps later bounds the target by j.
    pub hindsight_bound: bool,
    /// Share of a batch whose goals are states reached later in the same episode.
    pub goal_hindsight: f32,
    /// Share of the hindsight goals that lie a geometric number of steps ahead (the rest uniform in the future).
    pub goal_geometric: f32,
    /// Mean of that geometric number, in steps.
    pub goal_geometric_mean_steps: f32,
    /// Share of a batch whose goals are random states of the replay; the rest keep the goals really pursued.
    pub goal_random: f32,
    /// Scale on which a critic's error is measured.
    pub loss: LossScale,
    /// D = scale * softplus(network output), in steps.
    pub distance_scale_steps: f32,
    /// Actions are tanh(z); where |z| exceeds this it is pulled back, as a saturated actor has no gradient left to
    /// learn from. 0 for no bound.
    pub actor_bound: f32,
    /// Fourier features sin, cos(pi 2^l u) of positions u in [-1, 1], for l = 0 .. octaves - 1.
    pub fourier_octaves: usize,
    /// Scales c of the relative inputs tanh((g - s) / c), in goal radii (cells of a maze); empty for none.
    pub relative_scales: Vec<f32>,
    /// Cell sizes of the trainable grid encoding, in goal radii; empty for none. Only for environments whose goals
    /// are positions.
    pub grid_cells: Vec<f32>,
    /// Trainable numbers at each corner of each grid.
    pub grid_channels: usize,
    /// Adam's step size for the grid encoding.
    pub grid_learning_rate: f32,
    /// Share of a batch that are pairs of bridge candidates with their graph distance as the target, once there is
    /// a graph.
    pub distillation: f32,
    /// Transitions kept for replay.
    pub replay_capacity: usize,
    /// What computes updates.
    pub backend: Backend,
}

impl Default for LearnSettings {
    fn default() -> Self {
        Self {
            hidden: 128,
            layers: 2,
            learning_rate: 1e-3,
            tau: 0.005,
            batch: 64,
            critics: 2,
            n_step: 3,
            expectile: 0.55,
            greedy_targets: true,
            relearn_updates: 3_000,
            hindsight_bound: true,
            goal_hindsight: 0.5,
            goal_geometric: 0.5,
            goal_geometric_mean_steps: 25.0,
            goal_random: 0.25,
            loss: LossScale::Sqrt,
            distance_scale_steps: 40.0,
            actor_bound: 2.5,
            fourier_octaves: 3,
            relative_scales: vec![0.5, 1.0, 2.0, 4.0, 8.0, 32.0],
            grid_cells: vec![4.0, 2.0, 1.0, 0.5],
            grid_channels: 4,
            grid_learning_rate: 5e-3,
            distillation: 0.3,
            replay_capacity: 1_000_000,
            backend: Backend::Fused,
        }
    }
}

impl LearnSettings {
    /// The preset `paper`: Algorithm 1 without any of the additions.
    pub fn paper() -> Self {
        Self {
            critics: 1,
            n_step: 1,
            expectile: 0.5,
            greedy_targets: false,
            relearn_updates: 0,
            hindsight_bound: false,
            goal_hindsight: 0.0,
            goal_random: 0.0,
            loss: LossScale::Squared,
            actor_bound: 0.0,
            fourier_octaves: 0,
            relative_scales: Vec::new(),
            grid_cells: Vec::new(),
            distillation: 0.0,
            ..Self::default()
        }
    }

    /// Checks every value's range.
    ///
    /// # Errors
    /// The name of the first setting out of range, and what would be right.
    pub fn check(&self) -> Result<(), (&'static str, &'static str)> {
        let share = |v: f32| (0.0..=1.0).contains(&v);
        let positive = |v: f32| v > 0.0 && v.is_finite();
        let scales = |v: &[f32]| v.len() <= 16 && v.iter().all(|c| (0.01..=1e6).contains(c));
        let checks = [
            ("hidden", (1..=4096).contains(&self.hidden), "a whole number from 1 to 4096"),
            ("layers", (1..=8).contains(&self.layers), "a whole number from 1 to 8"),
            ("learning_rate", positive(self.learning_rate), "a number above 0"),
            ("tau", self.tau > 0.0 && self.tau <= 1.0, "a number above 0, at most 1"),
            ("batch", (1..=65_536).contains(&self.batch), "a whole number from 1 to 65536"),
            ("critics", (1..=2).contains(&self.critics), "1 or 2"),
            ("n_step", (1..=1000).contains(&self.n_step), "a whole number from 1 to 1000"),
            ("expectile", self.expectile > 0.0 && self.expectile < 1.0, "a number above 0 and below 1"),
            ("goal_hindsight", share(self.goal_hindsight), "a share from 0 to 1"),
            ("goal_geometric", share(self.goal_geometric), "a share from 0 to 1"),
            (
                "goal_geometric_mean_steps",
                self.goal_geometric_mean_steps >= 1.0 && self.goal_geometric_mean_steps.is_finite(),
                "a number of steps, at least 1",
            ),
            (
                "goal_random",
                share(self.goal_random) && self.goal_random + self.goal_hindsight <= 1.0,
                "a share from 0 to 1, and at most 1 together with goal_hindsight",
            ),
            ("distance_scale_steps", positive(self.distance_scale_steps), "a number above 0"),
            ("actor_bound", (0.0..=100.0).contains(&self.actor_bound), "a number from 0 to 100"),
            ("fourier_octaves", self.fourier_octaves <= 12, "a whole number from 0 to 12"),
            ("relative_scales", scales(&self.relative_scales), "up to 16 numbers above 0"),
            ("grid_cells", scales(&self.grid_cells), "up to 16 numbers above 0"),
            ("grid_channels", (1..=32).contains(&self.grid_channels), "a whole number from 1 to 32"),
            ("grid_learning_rate", positive(self.grid_learning_rate), "a number above 0"),
            ("distillation", share(self.distillation), "a share from 0 to 1"),
            (
                "replay_capacity",
                (1_000..=100_000_000).contains(&self.replay_capacity),
                "a whole number from 1000 to 100000000",
            ),
        ];
        checks.iter().find(|(_, ok, _)| !ok).map_or(Ok(()), |(name, _, right)| Err((*name, *right)))
    }
}
