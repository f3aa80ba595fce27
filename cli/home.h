/* What Home Assistant makes of a field: the kind of its entity, its device class and its state
 * class. The words, and the units that go with them, are those of Home Assistant's documentation.
 */
#pragma once

#include "device.h"

/* The kinds of entities, which Home Assistant calls components. */
enum {
    HOME_SENSOR,
    HOME_BINARY_SENSOR,
    HOME_NUMBER,
    HOME_SWITCH,
    HOME_SELECT,
    HOME_TEXT,
    HOME_BUTTON
};

/* State classes, and sets of them: 1 << HOME_TOTAL. */
enum { HOME_NO_STATE, HOME_MEASUREMENT, HOME_ANGLE, HOME_TOTAL, HOME_INCREASING };

typedef struct home_class {
    const char *name;
    const char *units;    /* separated by "|"; "" for none, NULL: any or none */
    uint8_t is_unit_free; /* the unit may be left out */
    uint8_t states;       /* the state classes that go with it, of sensors */
} home_class;

/* The words of state classes and of entities, by their numbers. NULL ends them. "none" is the first
 * state class. */
extern const char *const home_states[];
extern const char *const home_components[];

/* The number of the component of a field. */
int home_component(const device_field *field, const mbm_planField *planned);

/* Whether a field is bits, a text or several values; whether its numbers have names. */
int home_is_bit(const mbm_planField *planned);
int home_is_several(const mbm_planField *planned);
int home_has_names(const device_field *field, const mbm_planField *planned);

/* Whether a field is one number that Home Assistant shows as a number. */
int home_is_number(const device_field *field, const mbm_planField *planned);

/* The device classes of a component, in the order of the alphabet. Returns their number; 0: the
 * component has none. */
unsigned home_classes(int component, const home_class **classes);

/* The class of a component with this name, or NULL. */
const home_class *home_find_class(int component, const char *name);

/* Whether a unit goes with a class. A unit may be NULL. */
int home_has_unit(const home_class *of, const char *unit);

/* The device class and the state class that Home Assistant gets: those of the file, or those that
 * go with the unit of measurement. NULL, and HOME_NO_STATE, for none. */
const char *home_class_of(const device_field *field, const mbm_planField *planned);
int home_state_of(const device_field *field, const mbm_planField *planned);
