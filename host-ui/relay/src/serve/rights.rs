//! Rights of each role towards the core. Anything not listed is refused.

use crate::keys::Role;
use stylet_shm_schema::{CommandKind, RefusalCode};

/// Right needed by a remote request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Right {
    /// The role alone.
    Role,
    /// The lease: one hand holds the needle.
    Lease,
}

/// Returns what `role` needs for a request of that kind; `None` if it may never make one.
pub fn right(role: Role, kind: CommandKind) -> Option<Right> {
    use CommandKind as K;
    match (role, kind) {
        (Role::Observer, _) | (_, K::Shutdown) => None,
        // Everyone may remove force or motion.
        (_, K::StopHand | K::StopSecondHand | K::Disengage | K::SaveFlight | K::Rehearse | K::Mark) => {
            Some(Right::Role)
        }
        (Role::Instructor, K::SetParameters | K::LoadBuiltinScene | K::SetPlan) => Some(Right::Role),
        // Faults are for a trainee, who operates, to find.
        (role, K::BeginExercise | K::EndExercises) => (role == Role::Instructor).then_some(Right::Role),
        (Role::Instructor, _) => None,
        (Role::Operator, _) => Some(Right::Lease),
    }
}

/// Returns the right needed for a volume that replaces the scene.
pub fn right_to_upload(role: Role) -> Option<Right> {
    right(role, CommandKind::LoadBuiltinScene)
}

/// True if a request of a host next to the core shows that it operates.
///
/// A promise shows only that a host lives; a window here may send one for a motion that a member has taken over.
pub fn operates(kind: CommandKind) -> bool {
    kind != CommandKind::KeepMoving && right(Role::Operator, kind) == Some(Right::Lease)
}

/// Code for refusals by the relay, for which the core's list has no separate one.
pub const REFUSED: RefusalCode = RefusalCode::TooManyRequests;

#[cfg(test)]
mod tests {
    use super::*;

    fn kinds() -> impl Iterator<Item = CommandKind> {
        (0..64).filter_map(|number| CommandKind::try_from(number).ok())
    }

    #[test]
    fn an_observer_may_ask_for_nothing_and_nobody_may_end_the_core() {
        assert!(kinds().count() >= 20);
        for kind in kinds() {
            assert_eq!(right(Role::Observer, kind), None, "{kind:?}");
        }
        for role in [Role::Operator, Role::Instructor, Role::Observer] {
            assert_eq!(right(role, CommandKind::Shutdown), None);
        }
    }

    #[test]
    fn what_moves_the_needle_needs_the_lease_and_an_instructor_never_moves_it() {
        use CommandKind as K;
        for kind in [
            K::MoveHand,
            K::DropSeed,
            K::Engage,
            K::Reset,
            K::UndoSeed,
            K::LeaveNeedle,
            K::TakeNeedle,
            K::DrawNeedle,
            K::KeepMoving,
        ] {
            assert_eq!(right(Role::Operator, kind), Some(Right::Lease), "{kind:?}");
            assert_eq!(right(Role::Instructor, kind), None, "{kind:?}");
        }
        for kind in [K::BeginExercise, K::EndExercises] {
            assert_eq!(right(Role::Instructor, kind), Some(Right::Role), "{kind:?}");
            assert_eq!(right(Role::Operator, kind), None, "{kind:?}");
            assert!(
                !operates(kind),
                "an instructor beside the core takes the needle from nobody"
            );
        }
        assert!(operates(K::MoveHand) && !operates(K::KeepMoving));
        assert_eq!(right(Role::Operator, K::Mark), Some(Right::Role));
        assert_eq!(right(Role::Instructor, K::StopHand), Some(Right::Role));
        assert_eq!(right(Role::Operator, K::StopHand), Some(Right::Role));
    }
}
