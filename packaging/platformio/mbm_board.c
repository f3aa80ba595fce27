/* Stops the build on boards for which this package has no code, also in projects that include
 * only mbm.h.
 *
 * Licence: MIT OR Apache-2.0. */
#include "ModbusMasterBoards.h"

typedef int mbm_board_is_supported;
