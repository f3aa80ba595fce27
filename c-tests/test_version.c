/* The version: one number, in Cargo.toml. */
#include "mbm.h"
#include "test.h"

#include <stdio.h>
#include <string.h>

/* The version of a Cargo.toml. */
static void read_version(const char *path, char *version)
{
    FILE *file = fopen(path, "r");
    char line[200];

    assert_non_null(file);
    while (fgets(line, sizeof line, file))
        if (sscanf(line, "version = \"%19[0-9.]\"", version) == 1)
            break;
    (void)fclose(file);
}

TEST(the_version_is_that_of_the_packages_in_header_and_archive)
{
    char numbers[20], package[20];

    snprintf(numbers, sizeof numbers, "%d.%d.%d", MBM_VERSION_MAJOR, MBM_VERSION_MINOR,
             MBM_VERSION_PATCH);
    assert_string_equal(MBM_VERSION, numbers);
    assert_string_equal(mbm_version(), numbers);
    read_version("Cargo.toml", package);
    assert_string_equal(package, numbers);
}
