//! The map of units: which line a request goes to, and which unit it is for there.

/// [`Route::line`] of a broadcast to all lines, one after the other.
pub const ALL_LINES: u8 = 0xFF;

/// [`Route::line`] of units that the gateway serves itself.
pub const LOCAL: u8 = 0xFE;

/// [`Route::unit`] of a range that begins with unit 0 on its line, but with another id on TCP.
pub const UNIT_0: u16 = 0x100;

/// A range of unit ids on TCP, and where requests for them go.
///
/// ```
/// use mbm::gateway::{Destination, Route};
///
/// // Unit ids 11 to 19 on TCP are units 1 to 9 of line 0.
/// let routes = [Route { first: 11, last: 19, line: 0, unit: 1 }];
/// assert!(routes[0].is_valid(1));
/// assert_eq!(Route::find(&routes, 12), Some(Destination { line: 0, unit: 2 }));
/// assert_eq!(Route::find(&routes, 20), None);
/// ```
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Route {
    /// The first unit id on TCP.
    pub first: u16,
    /// The last unit id on TCP, at most 255.
    pub last: u16,
    /// The index of the line, [`ALL_LINES`] or [`LOCAL`].
    pub line: u8,
    /// The unit on the line that has the id `first` on TCP; the units after it follow. 0: the
    /// ids on the line are those on TCP. [`UNIT_0`]: `first` is unit 0 on the line.
    pub unit: u16,
}

/// Where a request goes.
///
/// ```
/// use mbm::gateway::{Destination, Route};
///
/// // The ids on the line are those on TCP.
/// let routes = [Route { first: 1, last: 247, line: 0, unit: 0 }];
/// assert_eq!(Route::find(&routes, 17), Some(Destination { line: 0, unit: 17 }));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Destination {
    /// As [`Route::line`].
    pub line: u8,
    /// The unit id there. 0 is a broadcast, except on a line with TCP frames.
    pub unit: u8,
}

impl Route {
    /// True if the range is not empty, leads to one of `lines` lines, and all unit ids there
    /// exist. Only a broadcast may go to all lines.
    pub fn is_valid(&self, lines: u8) -> bool {
        const LAST: u16 = u8::MAX as u16;
        if self.last > LAST || self.first > self.last {
            return false;
        }
        let exist =
            u16::from(self.unit as u8) + (self.last - self.first) <= LAST && self.unit <= UNIT_0;
        match self.line {
            ALL_LINES => self.last == 0 && self.unit == 0,
            LOCAL => exist,
            line => line < lines && exist,
        }
    }

    /// The first of the routes that has the unit id `unit` on TCP.
    pub fn find(routes: &[Route], unit: u8) -> Option<Destination> {
        let covers = |route: &&Route| (route.first..=route.last).contains(&unit.into());
        let route = routes.iter().find(covers)?;
        let unit = match route.unit {
            0 => unit,
            first => (first as u8).wrapping_add(unit.wrapping_sub(route.first as u8)),
        };
        Some(Destination {
            line: route.line,
            unit,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn route(first: u16, last: u16, line: u8, unit: u16) -> Route {
        Route {
            first,
            last,
            line,
            unit,
        }
    }

    #[test]
    fn a_range_of_units_is_rewritten() {
        let routes = [
            route(100, 110, 1, 1),
            route(1, 247, 0, 0),
            route(255, 255, 2, 7),
        ];
        let found = |unit| Route::find(&routes, unit).map(|found| (found.line, found.unit));
        assert_eq!(found(100), Some((1, 1)));
        assert_eq!(found(110), Some((1, 11)));
        assert_eq!(found(99), Some((0, 99)));
        assert_eq!(found(111), Some((0, 111)));
        assert_eq!(found(255), Some((2, 7)));
        assert_eq!(found(0), None);
        assert_eq!(found(248), None);
    }

    #[test]
    fn a_range_may_begin_with_unit_0_on_its_line() {
        let routes = [route(5, 8, 1, UNIT_0), route(0, 0, 0, 0)];
        let found = |unit| Route::find(&routes, unit).map(|found| (found.line, found.unit));
        assert_eq!(found(5), Some((1, 0)));
        assert_eq!(found(8), Some((1, 3)));
        assert_eq!(found(0), Some((0, 0)));
        assert_eq!(found(9), None);
    }

    #[test]
    fn a_route_that_leads_nowhere_is_invalid() {
        assert!(route(1, 247, 0, 0).is_valid(1));
        assert!(route(0, 255, 0, 0).is_valid(1));
        assert!(!route(1, 247, 1, 0).is_valid(1));
        assert!(!route(2, 1, 0, 0).is_valid(1));
        assert!(route(1, 10, 0, 246).is_valid(1));
        assert!(!route(1, 11, 0, 246).is_valid(1));
        assert!(route(0, 0, ALL_LINES, 0).is_valid(1));
        assert!(!route(0, 1, ALL_LINES, 0).is_valid(1));
        assert!(!route(0, 0, ALL_LINES, 5).is_valid(1));
        assert!(route(1, 1, LOCAL, 0).is_valid(0));
        assert!(!route(300, 300, 0, 0).is_valid(1));
        assert!(!route(1, 256, 0, 0).is_valid(1));
        assert!(route(5, 5, 0, UNIT_0).is_valid(1));
        assert!(route(0, 255, 0, UNIT_0).is_valid(1));
        assert!(!route(5, 5, 0, UNIT_0 + 1).is_valid(1));
        assert!(!route(0, 0, ALL_LINES, UNIT_0).is_valid(1));
        assert!(!route(5, 256, 0, UNIT_0).is_valid(1));
        assert!(!route(1, 1, LOCAL, 300).is_valid(1));
    }
}
