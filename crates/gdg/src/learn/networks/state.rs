//! Networks' training state in checkpoints.

use candle_core::Result;

use crate::learn::networks::network::Network;
use crate::store::{Store, StoreError};

/// State part that holds update counts, stored as the bits of floats.
const COUNTS: &str = "table_last";

/// Writes the state of `networks`, with their names, after `updates` updates.
///
/// # Errors
/// Returns candle's error if a tensor operation fails.
pub fn save_networks<'a>(
    store: &mut Store,
    updates: u64,
    networks: impl Iterator<Item = (&'a str, &'a Network)>,
) -> Result<()> {
    store.put_text("learner_updates", updates.to_string());
    for (network, of) in networks {
        for (part, values) in of.state()? {
            let name = format!("{network}.{part}");
            if part == COUNTS {
                store.put(name, values.into_iter().map(f32::to_bits).collect::<Vec<u32>>());
            } else {
                store.put(name, values);
            }
        }
    }
    Ok(())
}

/// Restores the state that [`save_networks`] wrote.
///
/// # Errors
/// Returns an error if the state is missing or does not fit; the networks are then unusable.
pub fn load_networks<'a>(
    store: &Store,
    mut networks: impl Iterator<Item = (&'a str, &'a Network)>,
) -> std::result::Result<(), StoreError> {
    let updates = store.text("learner_updates")?.parse::<u32>();
    let updates = updates
        .map_err(|_| StoreError::inconsistent("its number of updates is out of range"))?
        .into();
    let find = |network: &str, part: &str| {
        let name = format!("{network}.{part}");
        let counts =
            || store.u32(&name).map(|counts| counts.iter().copied().map(f32::from_bits).collect());
        store.f32(&name).map(<[f32]>::to_vec).or_else(|_| counts()).ok()
    };
    let mut restore =
        |(name, network): (&str, &Network)| network.restore(updates, |part| find(name, part));
    networks
        .try_for_each(&mut restore)
        .map_err(|e| StoreError::inconsistent(format!("its networks do not fit: {e}")))
}
