; Which instructions an x86-64 processor has, and the system lets use: 1 for those of the variant "avx2".

define i32 @iso_variant() #0 {
  %highest = call { i32, i32, i32, i32 } asm sideeffect "cpuid", "={ax},={bx},={cx},={dx},{ax},{cx}"(i32 0, i32 0)
  %leaves = extractvalue { i32, i32, i32, i32 } %highest, 0
  %old = icmp ult i32 %leaves, 7
  br i1 %old, label %no, label %basic
basic:
  %one = call { i32, i32, i32, i32 } asm sideeffect "cpuid", "={ax},={bx},={cx},={dx},{ax},{cx}"(i32 1, i32 0)
  %one_c = extractvalue { i32, i32, i32, i32 } %one, 2
  ; sse4.2 (20), popcnt (23), osxsave (27), avx (28)
  %basics = and i32 %one_c, 412090368
  %has_basics = icmp eq i32 %basics, 412090368
  br i1 %has_basics, label %system, label %no
system:
  %state = call { i32, i32 } asm sideeffect "xgetbv", "={ax},={dx},{cx}"(i32 0)
  %low = extractvalue { i32, i32 } %state, 0
  %vectors = and i32 %low, 6
  %kept = icmp eq i32 %vectors, 6
  br i1 %kept, label %further, label %no
further:
  %seven = call { i32, i32, i32, i32 } asm sideeffect "cpuid", "={ax},={bx},={cx},={dx},{ax},{cx}"(i32 7, i32 0)
  %seven_b = extractvalue { i32, i32, i32, i32 } %seven, 1
  ; bmi (3), avx2 (5), bmi2 (8)
  %news = and i32 %seven_b, 296
  %has_news = icmp eq i32 %news, 296
  %far = call { i32, i32, i32, i32 } asm sideeffect "cpuid", "={ax},={bx},={cx},={dx},{ax},{cx}"(i32 2147483649, i32 0)
  %far_c = extractvalue { i32, i32, i32, i32 } %far, 2
  ; lzcnt (5)
  %lzcnt = and i32 %far_c, 32
  %has_lzcnt = icmp ne i32 %lzcnt, 0
  %all = and i1 %has_news, %has_lzcnt
  %out = zext i1 %all to i32
  ret i32 %out
no:
  ret i32 0
}

attributes #0 = { nounwind }
