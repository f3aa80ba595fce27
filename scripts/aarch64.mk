# The tests in C as programs for AArch64, run by QEMU's user mode. The machine stays as it is: the
# libraries for AArch64 are unpacked below build.

AARCH64 := aarch64-linux-gnu
AARCH64_FOLDER := $(BUILD)/machines/$(AARCH64)
AARCH64_ARCHIVE := $(AARCH64_FOLDER)/libmbm.a
AARCH64_ROOT := $(AARCH64_FOLDER)/root
AARCH64_LIBRARIES := $(AARCH64_ROOT)/usr/lib/$(AARCH64)

.PHONY: archive-aarch64 test-aarch64 $(AARCH64_ARCHIVE)
# Phony, because Cargo decides what is out of date.
$(AARCH64_ARCHIVE):
	@scripts/need binutils-aarch64-linux-gnu
	+@CARGO="$(CARGO)" MBM_MACHINE=$(AARCH64) scripts/archive-host $@
archive-aarch64: $(AARCH64_ARCHIVE) ## Build the archive for 64-bit Arm Linux, build/machines/aarch64-linux-gnu/libmbm.a
	@echo "archive-aarch64: $(AARCH64_ARCHIVE)"

$(eval $(call variant,aarch64,$(AARCH64)-gcc,$(AARCH64)-g++,-isystem $(AARCH64_ROOT)/usr/include \
    -L$(AARCH64_LIBRARIES) -Wl$(comma)-rpath$(comma)$(CURDIR)/$(AARCH64_LIBRARIES),$(AARCH64_ARCHIVE)))

test-aarch64: ## Run the tests in C as programs for AArch64 under QEMU: TESTS, TEST as for test-c
	@scripts/need gcc-aarch64-linux-gnu g++-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user perl mbpoll openssl \
		pkg-config libmodbus-dev
	@scripts/foreign-packages arm64 $(AARCH64_ROOT) libmodbus-dev libmodbus5 libcmocka-dev libcmocka0 \
		libmbedtls-dev libmbedtls14 libmbedx509-1 libmbedcrypto7
	@$(MAKE) --no-print-directory -j$(JOBS) run-c-tests BUILDS=aarch64
