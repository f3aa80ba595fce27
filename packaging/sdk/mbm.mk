# For Makefiles: `include mbm-sdk/mbm.mk` after CC and CFLAGS are set. It sets
#
#   MBM_TARGET   the target of the compiler, unless you have set it: a folder of lib/
#   MBM_CFLAGS   for compiling
#   MBM_LIBS     for linking, after your objects
MBM_SDK := $(patsubst %/,%,$(dir $(lastword $(MAKEFILE_LIST))))
MBM_TARGET ?= $(shell $(CC) $(CFLAGS) -E -P -x c $(MBM_SDK)/lib/target.h | sed -n 's/MBM_TARGET "\(.*\)"/\1/p')
MBM_CFLAGS := -I$(MBM_SDK)/include
MBM_LIBS := $(MBM_SDK)/lib/$(MBM_TARGET)/libmbm.a
ifeq ($(wildcard $(MBM_LIBS)),)
$(error mbm has no archive for the target "$(MBM_TARGET)". MBM_TARGET can be one of: $(patsubst $(MBM_SDK)/lib/%/libmbm.a,%,$(wildcard $(MBM_SDK)/lib/*/libmbm.a)). For other targets compile $(MBM_SDK)/asm/mbm_*.S)
endif
