//! What hosts ask for: verified here, then an order for a loop, or a refusal with every reason.

use crate::rehearse::NeedleRun;
use crate::rt::exchange::{HapticOrder, Ticket, TissueOrder};
use nalgebra::Vector3;
use stylet_hw::{DeviceInfo, HandGoal};
use stylet_shm_schema::check::{MAX_COORDINATE_M, is_unit};
use stylet_shm_schema::*;
use stylet_sim::active::{Active, activate};

/// Fastest and slowest that the simulated hand is asked to move.
const SPEED_RANGE_M_PER_S: [f64; 2] = [1e-4, 1.0];
const ACCELERATION_RANGE_M_PER_S2: [f64; 2] = [1e-2, 100.0];

/// A request that makes sense.
pub enum Request {
    Parameters(Box<ParameterSet>, Box<Active>),
    Plan(Box<PlanInForce>),
    Haptic(fn(Ticket) -> HapticOrder),
    Hand(HandGoal),
    Tissue(fn(Ticket) -> TissueOrder),
    Reset,
    /// By name.
    BuiltinScene(&'static str),
    Shutdown,
    SaveFlight,
    Rehearse(Box<NeedleRun>),
}

impl Request {
    /// Takes the force off the hand.
    pub fn lets_go(&self) -> bool {
        let Self::Haptic(order) = self else { return false };
        matches!(order(0), HapticOrder::Disengage { .. })
    }
}

/// Reads one command; `Err` holds every reason against it, one a line.
pub fn read(command: &Command, now: &ParameterSet, device: &DeviceInfo) -> Result<Request, String> {
    let Some(kind) = CommandKind::from_number(command.kind) else {
        return Err(format!(
            "command number {} is not known; host and core differ",
            command.kind
        ));
    };
    let Some(values) = command.values.get(..command.value_count as usize) else {
        return Err(format!("{} values, at most {MAX_COMMAND_VALUES}", command.value_count));
    };
    if let Some(index) = values.iter().position(|v| !v.is_finite()) {
        return Err(format!("value {index} is not a number"));
    }
    match kind {
        CommandKind::SetParameters => parameters(values, now, device),
        CommandKind::SetPlan => plan(values).map(|p| Request::Plan(Box::new(p))),
        CommandKind::MoveHand => hand(values).map(Request::Hand),
        CommandKind::DropSeed => Ok(Request::Tissue(|ticket| TissueOrder::DropSeed { ticket })),
        CommandKind::UndoSeed => Ok(Request::Tissue(|ticket| TissueOrder::UndoSeed { ticket })),
        CommandKind::Engage => Ok(Request::Haptic(|ticket| HapticOrder::Engage { ticket })),
        CommandKind::Disengage => Ok(Request::Haptic(|ticket| HapticOrder::Disengage { ticket })),
        CommandKind::Reset => Ok(Request::Reset),
        CommandKind::LoadBuiltinScene => builtin_scene(values).map(Request::BuiltinScene),
        CommandKind::Shutdown => Ok(Request::Shutdown),
        CommandKind::SaveFlight => Ok(Request::SaveFlight),
        CommandKind::Rehearse => rehearsal(values).map(|run| Request::Rehearse(Box::new(run))),
        CommandKind::StopHand => Ok(Request::Haptic(|ticket| HapticOrder::StopHand { ticket })),
    }
}

fn parameters(values: &[f64], now: &ParameterSet, device: &DeviceInfo) -> Result<Request, String> {
    let (pairs, rest) = values.as_chunks::<2>();
    if pairs.is_empty() || !rest.is_empty() {
        return Err("parameters come in pairs of number and value".to_owned());
    }
    let mut set = *now;
    for [number, value] in pairs {
        let index = PARAMETERS.iter().position(|p| f64::from(p.id as u32) == *number);
        let Some(index) = index else {
            return Err(format!(
                "parameter number {number} is not known; there are {PARAMETER_COUNT}"
            ));
        };
        set.values[index] = *value;
    }
    activate(&set, device)
        .map(|active| Request::Parameters(Box::new(set), Box::new(active)))
        .map_err(|p| p.join("\n"))
}

fn coordinates(values: &[f64]) -> Result<[f64; 3], String> {
    match values {
        [x, y, z] if values.iter().all(|v| v.abs() <= MAX_COORDINATE_M) => Ok([*x, *y, *z]),
        _ => Err(format!(
            "a place needs three coordinates within {MAX_COORDINATE_M} m, not {values:?}"
        )),
    }
}

fn direction(values: &[f64]) -> Result<[f64; 3], String> {
    let d = coordinates(values)?;
    if is_unit(&d) {
        Ok(d)
    } else {
        Err(format!("the direction {d:?} is not a unit vector"))
    }
}

fn plan(values: &[f64]) -> Result<PlanInForce, String> {
    let mut plan: PlanInForce = bytemuck::Zeroable::zeroed();
    if values.is_empty() {
        return Ok(plan);
    }
    if values.len() < 6 || !values.len().is_multiple_of(3) || values.len() / 3 - 2 > MAX_SEEDS {
        return Err(format!(
            "a plan is entry, direction and at most {MAX_SEEDS} seeds, three values each; {} values came",
            values.len()
        ));
    }
    plan.generation = 1;
    plan.entry_m = coordinates(&values[..3])?;
    plan.direction = direction(&values[3..6])?;
    for (seed, place) in plan.seeds.iter_mut().zip(values[6..].chunks_exact(3)) {
        seed.position_m = coordinates(place)?;
    }
    plan.seed_count = (values.len() / 3 - 2) as u64;
    Ok(plan)
}

fn rehearsal(values: &[f64]) -> Result<NeedleRun, String> {
    let drops = values
        .len()
        .checked_sub(REHEARSAL_HEAD)
        .filter(|n| n % 3 == 0)
        .map(|n| n / 3);
    if !drops.is_some_and(|n| (1..=MAX_SEEDS).contains(&n)) {
        return Err(format!(
            "a rehearsal is {REHEARSAL_HEAD} values and 1 to {MAX_SEEDS} drops of three values each; {} values came",
            values.len()
        ));
    }
    let (head, drops) = values.split_at(REHEARSAL_HEAD);
    let mut problems = Vec::new();
    for (what, value, [low, high]) in [
        ("insertion in m/s", head[6], SPEED_RANGE_M_PER_S),
        ("retraction in m/s", head[7], SPEED_RANGE_M_PER_S),
        ("approach in m/s", head[8], SPEED_RANGE_M_PER_S),
        ("acceleration in m/s2", head[9], ACCELERATION_RANGE_M_PER_S2),
        ("place drawn back to, in m from the entry,", head[10], [-0.5, 0.5]),
    ] {
        if !(low..=high).contains(&value) {
            problems.push(format!("{what} is {value}; it must be {low} to {high}"));
        }
    }
    let mut told = |place: Result<[f64; 3], String>| place.map_err(|why| problems.push(why)).unwrap_or_default();
    let run = NeedleRun {
        entry_m: told(coordinates(&head[..3])).into(),
        direction: told(direction(&head[3..6])).into(),
        insert_m_per_s: head[6],
        retract_m_per_s: head[7],
        approach_m_per_s: head[8],
        acceleration_m_per_s2: head[9],
        retract_to_m: head[10],
        drops_m: drops
            .chunks_exact(3)
            .map(|drop| told(coordinates(drop)).into())
            .collect(),
    };
    if problems.is_empty() {
        Ok(run)
    } else {
        Err(problems.join("\n"))
    }
}

fn builtin_scene(values: &[f64]) -> Result<&'static str, String> {
    let number = match values {
        [] => 0.0,
        [number] => *number,
        _ => return Err(format!("a built-in scene is one number, {} values came", values.len())),
    };
    let found = (0..).zip(BUILTIN_SCENES).find(|(n, _)| f64::from(*n) == number);
    found.map(|(_, name)| name).ok_or_else(|| {
        let known = BUILTIN_SCENES.join(", ");
        format!("there is no built-in scene number {number}; from 0 they are {known}")
    })
}

fn hand(values: &[f64]) -> Result<HandGoal, String> {
    let [.., speed, acceleration] = values else {
        return Err("a hand goal has 8 values".to_owned());
    };
    if values.len() != 8 {
        return Err(format!("a hand goal has 8 values, not {}", values.len()));
    }
    for (what, value, [low, high]) in [
        ("speed in m/s", speed, SPEED_RANGE_M_PER_S),
        ("acceleration in m/s2", acceleration, ACCELERATION_RANGE_M_PER_S2),
    ] {
        if !(low..=high).contains(&value.to_owned()) {
            return Err(format!("{what} is {value}; it must be {low} to {high}"));
        }
    }
    Ok(HandGoal {
        tip_in_world: Vector3::from(coordinates(&values[..3])?),
        direction: Vector3::from(direction(&values[3..6])?),
        speed_m_per_s: *speed,
        acceleration_m_per_s2: *acceleration,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn try_read(kind: CommandKind, values: &[f64]) -> Result<Request, String> {
        read(
            &Command::new(1, 1, kind, values),
            &ParameterSet::default(),
            &DeviceInfo::phantom_premium_1_5(),
        )
    }

    #[test]
    fn rubbish_is_refused_with_its_reason() {
        let ones: Command = bytemuck::pod_read_unaligned(&[0xff; size_of::<Command>()]);
        let device = DeviceInfo::phantom_premium_1_5();
        assert!(read(&ones, &ParameterSet::default(), &device).is_err());
        let mut long = Command::new(1, 1, CommandKind::DropSeed, &[]);
        long.value_count = u32::MAX;
        assert!(read(&long, &ParameterSet::default(), &device).is_err_and(|e| e.contains("at most")));
        for (kind, values) in [
            (CommandKind::SetParameters, &[1e9, 1.0][..]),
            (CommandKind::SetParameters, &[1.0]),
            (CommandKind::SetParameters, &[0.0, f64::NAN]),
            (CommandKind::SetParameters, &[0.0, 40.0]),
            (CommandKind::SetPlan, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.5]),
            (CommandKind::SetPlan, &[0.0; 5]),
            (CommandKind::MoveHand, &[0.0, 0.0, 1e30, 0.0, 0.0, 1.0, 0.1, 1.0]),
            (CommandKind::MoveHand, &[0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1e9, 1.0]),
            (CommandKind::MoveHand, &[]),
            (CommandKind::Rehearse, &[0.0; 11]),
            (CommandKind::Rehearse, &[0.0; 15]),
            (CommandKind::Rehearse, &[0.0; 14]),
            (CommandKind::LoadBuiltinScene, &[3.0]),
            (CommandKind::LoadBuiltinScene, &[0.5]),
            (CommandKind::LoadBuiltinScene, &[-1.0]),
            (CommandKind::LoadBuiltinScene, &[0.0, 1.0]),
        ] {
            assert!(try_read(kind, values).is_err(), "{kind:?} {values:?}");
        }
    }

    #[test]
    fn a_built_in_scene_is_chosen_by_its_place_in_the_list() {
        for (values, expected) in [
            (&[][..], "paper"),
            (&[0.0], "paper"),
            (&[1.0], "pelvis"),
            (&[2.0], "full"),
        ] {
            let read = try_read(CommandKind::LoadBuiltinScene, values);
            assert!(matches!(read, Ok(Request::BuiltinScene(name)) if name == expected));
        }
    }

    #[test]
    fn a_rehearsal_tells_every_bad_value_and_keeps_its_drops_in_order() {
        let mut values = [0.0; 17];
        (values[5], values[9], values[11], values[16]) = (1.0, 2.0, 0.1, 0.2);
        values[6..9].fill(0.05);
        let Ok(Request::Rehearse(run)) = try_read(CommandKind::Rehearse, &values) else {
            panic!("refused")
        };
        assert_eq!((run.drops_m[0].x, run.drops_m[1].z, run.drops_m.len()), (0.1, 0.2, 2));
        (values[5], values[6], values[9], values[12]) = (0.9, 0.0, 1e9, 30.0);
        let why = try_read(CommandKind::Rehearse, &values).err().unwrap();
        for words in ["unit vector", "insertion", "acceleration", "within 20 m"] {
            assert!(why.contains(words), "{words}: {why}");
        }
    }

    #[test]
    fn a_plan_keeps_its_seeds_in_order() {
        let values = [0.0, 0.0, -0.01, 0.0, 0.0, 1.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6];
        let Ok(Request::Plan(plan)) = try_read(CommandKind::SetPlan, &values) else {
            panic!("refused")
        };
        assert_eq!((plan.seed_count, plan.seeds[1].position_m), (2, [0.4, 0.5, 0.6]));
    }
}
