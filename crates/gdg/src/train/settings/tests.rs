//! Every setting does what its entry says.

use serde_json::json;

use super::*;
use crate::settings::Excluded;
use crate::settings::values::Kind;
use crate::train::with_setting;

/// Returns the default settings with one value, as a file would have it; `None` if that has
/// another type.
fn with(setting: &Setting, value: Value) -> Option<Settings> {
    let mut values = Settings::default().values();
    if setting.name == "goal_random" {
        // Leaves room for all of its own range.
        values["goal_hindsight"] = 0.into();
    }
    values.insert(setting.name.to_owned(), value);
    serde_json::from_value(Value::Object(values)).ok()
}

/// Checks that exactly the `valid` values are accepted, and that the field can hold them.
fn check(setting: &Setting, valid: &[Value], invalid: &[Value]) {
    let accepted = |value: &Value| {
        let settings = with(setting, value.clone());
        settings.is_some_and(|settings| match settings.validate_ranges() {
            Ok(()) => settings.values()[setting.name] == *value,
            Err(OutOfRange(wrong)) => wrong.name != setting.name,
        })
    };
    for value in valid {
        assert!(accepted(value), "{} can be {value}: {}", setting.name, setting.values);
    }
    for value in invalid {
        assert!(!accepted(value), "{} cannot be {value}: {}", setting.name, setting.values);
    }
}

fn number(value: f32) -> Value {
    let text = serde_json::to_string(&value).unwrap_or_default();
    serde_json::from_str(&text).unwrap_or(Value::Null)
}

#[test]
fn the_documented_bounds_are_the_checked_ones() {
    for setting in SETTINGS.iter() {
        if setting.values.or_auto {
            check(setting, &["auto".into()], &["automatic".into()]);
        }
        match setting.values.kind {
            Kind::Switch => check(setting, &[true.into(), false.into()], &[0.into()]),
            Kind::Word(words) => {
                let words: Vec<Value> = words.iter().map(|word| (*word).into()).collect();
                check(setting, &words, &["other".into(), 1.into()]);
            }
            Kind::Count { from, to } => {
                let below = from.checked_sub(1).map_or(json!(-1), Value::from);
                check(setting, &[from.into()], &[below, json!(from as f64 + 0.5)]);
                if let Some(to) = to {
                    check(setting, &[to.into()], &[(to + 1).into()]);
                }
            }
            Kind::Number { from, to, excluded, .. } => {
                let (mut valid, mut invalid) = (vec![], vec![from.next_down(), to.next_up()]);
                let lower = matches!(excluded, Excluded::Lower | Excluded::Both);
                let upper = matches!(excluded, Excluded::Upper | Excluded::Both);
                for (end, is_excluded, next) in
                    [(from, lower, from.next_up()), (to, upper, to.next_down())]
                {
                    if is_excluded { &mut invalid } else { &mut valid }.push(end);
                    valid.push(next);
                }
                let [valid, invalid] =
                    [valid, invalid].map(|all| all.into_iter().map(number).collect::<Vec<_>>());
                check(setting, &valid, &invalid);
            }
            Kind::Numbers { max_len, from, to } => {
                let list = |value: f32, len: usize| Value::from(vec![number(value); len]);
                check(
                    setting,
                    &[list(from, max_len), list(to, 1), list(1.0, 0)],
                    &[list(1.0, max_len + 1), list(from.next_down(), 1), list(to.next_up(), 1)],
                );
            }
        }
    }
}

#[test]
fn every_field_has_an_entry_and_every_entry_a_field() {
    let Ok(Value::Object(fields)) = serde_json::to_value(Settings::default()) else {
        panic!("settings are an object")
    };
    let mut fields: Vec<&str> = fields.keys().map(String::as_str).collect();
    let values = Settings::default().values();
    let mut entries: Vec<&str> = SETTINGS.iter().map(|setting| setting.name).collect();
    assert_eq!(entries, values.keys().collect::<Vec<_>>(), "in the order of the entries");
    fields.sort_unstable();
    entries.sort_unstable();
    assert_eq!(fields, entries);
}

#[test]
fn presets_and_ablations_are_valid() {
    for preset in Preset::ALL {
        assert!(preset.settings().validate().is_ok(), "{}", preset.name());
    }
    let default = Settings::default();
    for setting in SETTINGS.iter() {
        let Some(ablation) = setting.ablation else { continue };
        let changed = with_setting(&default, setting.name, ablation.value);
        assert!(changed.is_ok_and(|changed| changed != default), "{}", ablation.name);
    }
}

#[test]
fn the_maps_goal_alone_and_what_contradicts_it_are_refused_together() {
    let paper = Preset::Paper.settings();
    assert_eq!(paper.contradicting_goals(), [""; 0]);
    let error = with_setting(&paper, "goals", "map").expect_err("goals nearby, starts anywhere");
    assert_eq!(error.help, "set near_goals=0 and restart=start-cell as well");
    let mut own = with_setting(&paper, "near_goals", "0").expect("no near goals");
    for restart in ["anywhere", "never"] {
        own = with_setting(&own, "restart", restart).expect("starts elsewhere");
        let error = with_setting(&own, "goals", "map").expect_err("starts elsewhere");
        assert_eq!(error.help, "set restart=start-cell as well");
    }
    for restart in ["auto", "start-cell"] {
        own = with_setting(&own, "restart", restart).expect("starts at S");
        let own = with_setting(&own, "goals", "map").expect("from S to G");
        assert!(own.validate().is_ok());
        assert!(with_setting(&own, "near_goals", "0.1").is_err());
    }
    own.train.goals = Goals::Map;
    own.train.restart = Restart::Never;
    assert!(own.validate().is_err_and(|OutOfRange(setting)| setting.name == "goals"));
}

#[test]
fn episodes_grow_with_what_is_known_as_far_as_the_buffer_allows() {
    let mut settings = Settings::default();
    assert_eq!([0.0, 40.0, 240.0].map(|longest| settings.episode_steps(longest)), [150, 150, 720]);
    settings.learn.buffer_size = 32 * 201;
    assert_eq!(settings.episode_steps(240.0), 200);
    settings.train.episode_steps = Auto::Given(77);
    assert_eq!(settings.episode_steps(240.0), 77);
}
