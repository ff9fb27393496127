//! The same update in plain candle-nn: the baseline for the fused one.

use candle_core::{D, DType, Device, Result, Tensor, Var};
use candle_nn::{AdamW, Linear, Module, Optimizer, ParamsAdamW, VarBuilder, VarMap, linear};

use gdg::learn::{Batch, LearnSettings};

/// A perceptron of candle-nn layers and its optimiser.
struct Network {
    layers: Vec<Linear>,
    vars: VarMap,
    optimiser: AdamW,
}

impl Network {
    fn new(inputs: usize, hidden: usize, outputs: usize, learning_rate: f64) -> Result<Self> {
        let vars = VarMap::new();
        let builder = VarBuilder::from_varmap(&vars, DType::F32, &Device::Cpu);
        let layers = vec![
            linear(inputs, hidden, builder.pp("0"))?,
            linear(hidden, hidden, builder.pp("1"))?,
            linear(hidden, outputs, builder.pp("2"))?,
        ];
        let parameters =
            ParamsAdamW { lr: learning_rate, weight_decay: 0.0, ..ParamsAdamW::default() };
        Ok(Self { layers, optimiser: AdamW::new(vars.all_vars(), parameters)?, vars })
    }

    fn forward(&self, x: &Tensor) -> Result<Tensor> {
        let h = self.layers[0].forward(x)?.relu()?;
        self.layers[2].forward(&self.layers[1].forward(&h)?.relu()?)
    }

    /// Returns the variables sorted by name, so that those of two networks correspond.
    fn sorted_vars(&self) -> Vec<Var> {
        let names = self.vars.data().lock().map(|data| {
            let mut named: Vec<_> =
                data.iter().map(|(name, var)| (name.clone(), var.clone())).collect();
            named.sort_by(|a, b| a.0.cmp(&b.0));
            named.into_iter().map(|(_, var)| var).collect()
        });
        names.unwrap_or_default()
    }
}

/// Algorithm 1's update with one critic, scaled inputs and squared loss.
pub struct Baseline {
    critic: Network,
    target: Network,
    model: Network,
    actor: Network,
    tau: f64,
}

impl Baseline {
    /// Creates networks for two-dimensional states, goals and actions.
    pub fn new(settings: &LearnSettings) -> Result<Self> {
        let rate = f64::from(settings.learning_rate);
        let network = |outputs| Network::new(4, settings.hidden, outputs, rate);
        let tau = f64::from(settings.tau);
        Ok(Self {
            critic: network(1)?,
            target: network(1)?,
            model: network(2)?,
            actor: network(2)?,
            tau,
        })
    }

    fn distance(network: &Network, states: &Tensor, goals: &Tensor) -> Result<Tensor> {
        let z = network.forward(&Tensor::cat(&[states, goals], 1)?)?.squeeze(1)?;
        // Softplus, as in the fused critic.
        (z.relu()? + (z.abs()?.neg()?.exp()? + 1.0)?.log()?)? * 40.0
    }

    /// Performs one update.
    pub fn update(&mut self, batch: &Batch) -> Result<()> {
        let tensor =
            |numbers: &[f32]| Tensor::from_slice(numbers, (numbers.len() / 2, 2), &Device::Cpu);
        let column = |numbers: &[f32]| Tensor::from_slice(numbers, numbers.len(), &Device::Cpu);
        let (states, goals, ahead) =
            (tensor(&batch.states)?, tensor(&batch.goals)?, tensor(&batch.bootstrap_states)?);
        let bootstrapped =
            (Self::distance(&self.target, &ahead, &goals)? * column(&batch.bootstrap)?)?;
        let targets = (bootstrapped + column(&batch.steps)?)?.detach();
        let critic =
            (Self::distance(&self.critic, &states, &goals)? - targets)?.sqr()?.mean_all()?;
        self.critic.optimiser.backward_step(&critic)?;
        let (from, actions, next) =
            (tensor(&batch.from)?, tensor(&batch.actions)?, tensor(&batch.next)?);
        let predicted = (&from + self.model.forward(&Tensor::cat(&[&from, &actions], 1)?)?)?;
        let model = (predicted - next)?.sqr()?.sum(D::Minus1)?.mean_all()?;
        self.model.optimiser.backward_step(&model)?;
        let action = self.actor.forward(&Tensor::cat(&[&states, &goals], 1)?)?.tanh()?;
        let reached = (&states + self.model.forward(&Tensor::cat(&[&states, &action], 1)?)?)?;
        let actor = Self::distance(&self.critic, &reached, &goals)?.mean_all()?;
        self.actor.optimiser.backward_step(&actor)?;
        for (average, current) in self.target.sorted_vars().iter().zip(self.critic.sorted_vars()) {
            average.set(
                &((average.as_tensor() * (1.0 - self.tau))? + (current.as_tensor() * self.tau)?)?,
            )?;
        }
        Ok(())
    }
}
