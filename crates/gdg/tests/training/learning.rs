//! Distance is learned, and the actor follows it.

use super::*;

/// Networks that hardly change show that the thresholds detect learning.
#[test]
fn two_rooms_are_learned_and_not_by_frozen_networks() {
    let [mut learning, mut frozen] = [settings(), settings()];
    (frozen.learn.learning_rate, frozen.learn.grid_learning_rate) = (1e-8, 1e-8);
    let [[planned, greedy], [idle, greedy_idle]] = [&mut learning, &mut frozen].map(|settings| {
        let mut run = trainer(settings.clone(), 11, 2);
        train_to(&mut run, 4_000);
        let bridges = evaluated(&run, 1).bridges.unwrap();
        assert_eq!(bridges.false_edges, Some(0));
        assert!(bridges.candidates > 10 && bridges.edges > bridges.candidates);
        success(&run, 20)
    });
    assert!(planned >= 0.9 && greedy >= 0.6, "planned {planned}, greedy {greedy}");
    assert!(idle < 0.6 && greedy_idle < 0.3, "planned {idle}, greedy {greedy_idle}");
}

#[test]
fn learned_distances_bend_around_the_wall() {
    let mut run = trainer(settings(), 12, 2);
    train_to(&mut run, 4_000);
    let policy = run.policy().unwrap();
    let distance =
        |from: [f32; 2], to: [f32; 2]| policy.distance(&from, &to, &mut Scratch::default());
    // Close to each other, with the wall between: 2 steps through it, 17 around it.
    let (through, round) = (distance([9.5, 0.5], [11.5, 0.5]), distance([9.5, 0.5], [7.5, 0.5]));
    assert!(through > 8.0, "across the wall D is {through}");
    assert!(round < 5.0, "along the wall D is {round}");
}
