#include "watched.h"
#include "test.h"

watched watching;

static void add(const char *text)
{
    size_t length = strlen(text);

    if (watching.length + length >= sizeof watching.text)
        abort();
    memcpy(watching.text + watching.length, text, length + 1);
    watching.length += length;
}

static void note(char hook, const mbm_access *access)
{
    int is_bits = access->function == 0x05 || access->function == 0x0F;
    unsigned i, bytes = is_bits ? (access->quantity + 7u) / 8 : 2u * access->quantity;
    char text[40], file[8] = "";

    if (access->file != 0)
        snprintf(file, sizeof file, "%u:", access->file);
    snprintf(text, sizeof text, "%c%u/%02X %s%u+%u", hook, access->unit, access->function, file,
             access->address, access->quantity);
    add(text);
    for (i = 0; access->data != NULL && i < bytes; i++) {
        snprintf(text, sizeof text, "%s%02X", i == 0 ? " " : "", access->data[i]);
        add(text);
    }
    add(";");
    watching.connection = access->connection;
    if (watching.within != NULL)
        watching.within(hook, access);
}

static uint8_t before_read(void *context, const mbm_access *access)
{
    assert_ptr_equal(context, &watching);
    note('r', access);
    return watching.refuse_read;
}

static uint8_t before_write(void *context, const mbm_access *access)
{
    assert_ptr_equal(context, &watching);
    note('w', access);
    return watching.refuse_write;
}

static void after_write(void *context, const mbm_access *access)
{
    assert_ptr_equal(context, &watching);
    note('a', access);
}

void watched_reset(void)
{
    memset(&watching, 0, sizeof watching);
    watching.hooks.context = &watching;
    watching.hooks.beforeRead = before_read;
    watching.hooks.beforeWrite = before_write;
    watching.hooks.afterWrite = after_write;
}

void watched_set(served *s)
{
    OK(mbm_registerTable_setHooks(&s->holding, &watching.hooks));
    OK(mbm_registerTable_setHooks(&s->inputs, &watching.hooks));
    OK(mbm_bitTable_setHooks(&s->coils, &watching.hooks));
    OK(mbm_bitTable_setHooks(&s->discrete, &watching.hooks));
    OK(mbm_files_setHooks(&s->files, &watching.hooks));
}

void watched_were(const char *calls)
{
    assert_string_equal(watching.text, calls);
    watching.length = 0;
    watching.text[0] = 0;
}
