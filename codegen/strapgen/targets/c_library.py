"""Names of the C library and its headers, which no function or file of a kernel can have.

C99 to C23 and POSIX.1-2008 declare them, or compilers and libraries add them when no standard is set. A rule covers the
names that end in ``_t``. Only external names are concerned: a function can use any of these for a variable, unless it
calls the library's function.
"""

from __future__ import annotations

#: Functions, variables and headers, by the form that the name of a kernel can have.
_LIBRARY_TEXT = """
a64l abort abs accept access acct acos acosf acosh acoshf acoshl acosl acospi aio aio_cancel aio_error
aio_fsync aio_read aio_return aio_suspend aio_write alarm aligned_alloc alloca alphasort arc4random
arc4random_buf arc4random_uniform argp asctime asctime_r asin asinf asinh asinhf asinhl asinl asinpi asprintf
assert at_quick_exit atan atan2 atan2f atan2l atan2pi atanf atanh atanhf atanhl atanl atanpi atexit atof atoi
atol atoll basename bcmp bcopy bind brk bsearch btowc bzero c16rtomb c32rtomb cabs cabsf cabsl cacos cacosf
cacosh cacoshf cacoshl cacosl call_once calloc canonicalize canonicalize_file_name canonicalizef canonicalizel
carg cargf cargl casin casinf casinh casinhf casinhl casinl catan catanf catanh catanhf catanhl catanl
catclose catgets catopen cbrt cbrtf cbrtl ccos ccosf ccosh ccoshf ccoshl ccosl ceil ceilf ceill cexp cexpf
cexpl cfgetispeed cfgetospeed cfsetispeed cfsetospeed chdir chmod chown chroot cimag cimagf cimagl clearenv
clearerr clearerr_unlocked clock clock_adjtime clock_getcpuclockid clock_getres clock_gettime clock_nanosleep
clock_settime clog clog10 clog10f clog10l clogf clogl close close_range closedir closefrom closelog
cnd_broadcast cnd_destroy cnd_init cnd_signal cnd_timedwait cnd_wait complex compoundn confstr conio conj
conjf conjl connect copy_file_range copysign copysignf copysignl cos cosf cosh coshf coshl cosl cospi cpio
cpow cpowf cpowl cproj cprojf cprojl creal crealf creall creat crypt csin csinf csinh csinhf csinhl csinl
csqrt csqrtf csqrtl ctan ctanf ctanh ctanhf ctanhl ctanl ctermid ctime ctime_r ctype cuserid daddl daemon
daylight dcgettext ddivl dfmal dgettext difftime dirent dirfd dirname div dlclose dlerror dlfcn dlopen dlsym
dmull dprintf drand48 drand48_r drem dremf dreml dsqrtl dsubl dup dup2 dup3 duplocale dysize eaccess ecvt
ecvt_r endgrent endhostent endian endnetent endprotoent endpwent endservent endusershell endutxent environ
erand48 erand48_r erf erfc erfcf erfcl erff erfl err errno error euidaccess execl execle execlp execv execve
execveat execvp execvpe exit exp exp10 exp10f exp10l exp10m1 exp2 exp2f exp2l exp2m1 expf expl explicit_bzero
expm1 expm1f expm1l fabs fabsf fabsl faccessat fadd faddl fchdir fchmod fchmodat fchown fchownat fclose
fcloseall fcntl fcvt fcvt_r fdatasync fdim fdimf fdiml fdiv fdivl fdopen fdopendir features feclearexcept
fedisableexcept feenableexcept fegetenv fegetexcept fegetexceptflag fegetmode fegetround feholdexcept fenv
feof feof_unlocked feraiseexcept ferror ferror_unlocked fesetenv fesetexcept fesetexceptflag fesetmode
fesetround fetestexcept fetestexceptflag feupdateenv fexecve fflush fflush_unlocked ffma ffmal ffs ffsl ffsll
fgetc fgetc_unlocked fgetpos fgetpos64 fgets fgets_unlocked fgetwc fgetwc_unlocked fgetws fgetws_unlocked
fileno fileno_unlocked finite finitef finitel float flockfile floor floorf floorl fma fmaf fmal fmax fmaxf
fmaximum fmaximum_mag fmaximum_mag_num fmaximum_mag_numf fmaximum_mag_numl fmaximum_magf fmaximum_magl
fmaximum_num fmaximum_numf fmaximum_numl fmaximumf fmaximuml fmaxl fmaxmag fmaxmagf fmaxmagl fmemopen fmin
fminf fminimum fminimum_mag fminimum_mag_num fminimum_mag_numf fminimum_mag_numl fminimum_magf fminimum_magl
fminimum_num fminimum_numf fminimum_numl fminimumf fminimuml fminl fminmag fminmagf fminmagl fmod fmodf fmodl
fmtmsg fmul fmull fnmatch fopen fopen64 fopencookie fork fpathconf fpclassify fprintf fprintf_unlocked fputc
fputc_unlocked fputs fputs_unlocked fputwc fputwc_unlocked fputws fputws_unlocked fread fread_unlocked free
freeaddrinfo freelocale freopen freopen64 frexp frexpf frexpl fromfp fromfpf fromfpl fromfpx fromfpxf fromfpxl
fscanf fseek fseeko fseeko64 fsetpos fsetpos64 fsqrt fsqrtl fstat fstatat fstatvfs fsub fsubl fsync ftell
ftello ftello64 ftok ftruncate ftruncate64 ftrylockfile ftw funlockfile futimens fwide fwprintf fwrite
fwrite_unlocked fwscanf gai_strerror gamma gammaf gammaf_r gammal gammal_r gcvt get_current_dir_name
getaddrinfo getc getc_unlocked getchar getchar_unlocked getcwd getdate getdate_err getdate_r getdelim
getdomainname getdtablesize getegid getentropy getenv geteuid getgid getgrent getgrgid getgrgid_r getgrnam
getgrnam_r getgroups gethostbyaddr gethostbyname gethostent gethostid gethostname getitimer getline getloadavg
getlogin getlogin_r getnameinfo getnetbyaddr getnetbyname getnetent getopt getpagesize getpass getpayload
getpayloadf getpayloadl getpeername getpgid getpgrp getpid getppid getpriority getprotobyname getprotobynumber
getprotoent getpt getpwent getpwnam getpwnam_r getpwuid getpwuid_r getresgid getresuid getrlimit getrusage
gets getservbyname getservbyport getservent getsid getsockname getsockopt getsubopt gettext gettid
gettimeofday getuid getusershell getutxent getutxid getutxline getw getwc getwc_unlocked getwchar
getwchar_unlocked getwd glob globfree gmtime gmtime_r grantpt group_member grp gsignal hcreate hdestroy
hsearch htonl htons hypot hypotf hypotl i386 iconv iconv_close iconv_open if_freenameindex if_indextoname
if_nameindex if_nametoindex ilogb ilogbf ilogbl imaxabs imaxdiv in6addr_any in6addr_loopback index inet_addr
inet_lnaof inet_makeaddr inet_netof inet_network inet_ntoa inet_ntop inet_pton initstate initstate_r insque
inttypes io isalnum isalnum_l isalpha isalpha_l isascii isatty isblank isblank_l iscntrl iscntrl_l isctype
isdigit isdigit_l isfinite isgraph isgraph_l isgreater isgreaterequal isinf isinff isinfl isless islessequal
islessgreater islower islower_l isnan isnanf isnanl isnormal iso646 isprint isprint_l ispunct ispunct_l
isspace isspace_l isunordered isupper isupper_l iswalnum iswalnum_l iswalpha iswalpha_l iswblank iswblank_l
iswcntrl iswcntrl_l iswctype iswctype_l iswdigit iswdigit_l iswgraph iswgraph_l iswlower iswlower_l iswprint
iswprint_l iswpunct iswpunct_l iswspace iswspace_l iswupper iswupper_l iswxdigit iswxdigit_l isxdigit
isxdigit_l itoa j0 j0f j0l j1 j1f j1l jn jnf jnl jrand48 jrand48_r kill killpg l64a labs langinfo lchown
lcong48 lcong48_r ldexp ldexpf ldexpl ldiv lfind lgamma lgamma_r lgammaf lgammaf_r lgammal lgammal_r libgen
limits link linkat linux lio_listio listen llabs lldiv llogb llogbf llogbl llrint llrintf llrintl llround
llroundf llroundl locale localeconv localtime localtime_r lockf log log10 log10f log10l log10p1 log1p log1pf
log1pl log2 log2f log2l log2p1 logb logbf logbl logf logl logp1 longjmp lrand48 lrand48_r lrint lrintf lrintl
lround lroundf lroundl lsearch lseek lseek64 lstat ltoa main malloc math mblen mbrlen mbrtoc16 mbrtoc32
mbrtowc mbsinit mbsnrtowcs mbsrtowcs mbstowcs mbtowc memccpy memchr memcmp memcpy memfrob memmem memmove
memory mempcpy memrchr memset mkdir mkdirat mkdtemp mkfifo mkfifoat mknod mknodat mkostemp mkostemp64
mkostemps mkostemps64 mkstemp mkstemp64 mkstemps mkstemps64 mktemp mktime mlock mlockall mmap modf modff modfl
monetary mprotect mq_close mq_getattr mq_notify mq_open mq_receive mq_send mq_setattr mq_timedreceive
mq_timedsend mq_unlink mqueue mrand48 mrand48_r msgctl msgget msgrcv msgsnd msync mtx_destroy mtx_init
mtx_lock mtx_timedlock mtx_trylock mtx_unlock munlock munlockall munmap nan nanf nanl nanosleep nearbyint
nearbyintf nearbyintl netdb newlocale nextafter nextafterf nextafterl nextdown nextdownf nextdownl nexttoward
nexttowardf nexttowardl nextup nextupf nextupl nftw nice nl_langinfo nl_langinfo_l nl_types nrand48 nrand48_r
ntohl ntohs obstack_printf obstack_vprintf offsetof on_exit open open_memstream open_wmemstream openat opendir
openlog optarg opterr optind optopt pathconf pause pclose perror pipe pipe2 poll popen posix_fadvise
posix_fallocate posix_madvise posix_memalign posix_openpt posix_spawn posix_spawn_file_actions_addclose
posix_spawn_file_actions_adddup2 posix_spawn_file_actions_addopen posix_spawn_file_actions_destroy
posix_spawn_file_actions_init posix_spawnattr_destroy posix_spawnattr_getflags posix_spawnattr_getpgroup
posix_spawnattr_getschedparam posix_spawnattr_getschedpolicy posix_spawnattr_getsigdefault
posix_spawnattr_getsigmask posix_spawnattr_init posix_spawnattr_setflags posix_spawnattr_setpgroup
posix_spawnattr_setschedparam posix_spawnattr_setschedpolicy posix_spawnattr_setsigdefault
posix_spawnattr_setsigmask posix_spawnp pow pow10 powf powl pown powr pread pread64 printf printf_unlocked
process profil program_invocation_name program_invocation_short_name pselect psiginfo psignal pthread
pthread_atfork pthread_attr_destroy pthread_attr_getdetachstate pthread_attr_getguardsize
pthread_attr_getinheritsched pthread_attr_getschedparam pthread_attr_getschedpolicy pthread_attr_getscope
pthread_attr_getstack pthread_attr_getstackaddr pthread_attr_getstacksize pthread_attr_init
pthread_attr_setdetachstate pthread_attr_setguardsize pthread_attr_setinheritsched pthread_attr_setschedparam
pthread_attr_setschedpolicy pthread_attr_setscope pthread_attr_setstack pthread_attr_setstackaddr
pthread_attr_setstacksize pthread_barrier_destroy pthread_barrier_init pthread_barrier_wait
pthread_barrierattr_destroy pthread_barrierattr_getpshared pthread_barrierattr_init
pthread_barrierattr_setpshared pthread_cancel pthread_cond_broadcast pthread_cond_destroy pthread_cond_init
pthread_cond_signal pthread_cond_timedwait pthread_cond_wait pthread_condattr_destroy
pthread_condattr_getclock pthread_condattr_getpshared pthread_condattr_init pthread_condattr_setclock
pthread_condattr_setpshared pthread_create pthread_detach pthread_equal pthread_exit pthread_getconcurrency
pthread_getcpuclockid pthread_getschedparam pthread_getspecific pthread_join pthread_key_create
pthread_key_delete pthread_kill pthread_mutex_consistent pthread_mutex_destroy pthread_mutex_getprioceiling
pthread_mutex_init pthread_mutex_lock pthread_mutex_setprioceiling pthread_mutex_timedlock
pthread_mutex_trylock pthread_mutex_unlock pthread_mutexattr_destroy pthread_mutexattr_getprioceiling
pthread_mutexattr_getprotocol pthread_mutexattr_getpshared pthread_mutexattr_getrobust
pthread_mutexattr_gettype pthread_mutexattr_init pthread_mutexattr_setprioceiling
pthread_mutexattr_setprotocol pthread_mutexattr_setpshared pthread_mutexattr_setrobust
pthread_mutexattr_settype pthread_once pthread_rwlock_destroy pthread_rwlock_init pthread_rwlock_rdlock
pthread_rwlock_timedrdlock pthread_rwlock_timedwrlock pthread_rwlock_tryrdlock pthread_rwlock_trywrlock
pthread_rwlock_unlock pthread_rwlock_wrlock pthread_rwlockattr_destroy pthread_rwlockattr_getkind_np
pthread_rwlockattr_getpshared pthread_rwlockattr_init pthread_rwlockattr_setkind_np
pthread_rwlockattr_setpshared pthread_self pthread_setcancelstate pthread_setcanceltype pthread_setconcurrency
pthread_setschedparam pthread_setschedprio pthread_setspecific pthread_sigmask pthread_sigqueue
pthread_spin_destroy pthread_spin_init pthread_spin_lock pthread_spin_trylock pthread_spin_unlock
pthread_testcancel ptsname ptsname_r putc putc_unlocked putchar putchar_unlocked putenv puts pututxline putw
putwc putwc_unlocked putwchar putwchar_unlocked pwd pwrite pwrite64 python qecvt qecvt_r qfcvt qfcvt_r qgcvt
qsort qsort_r quick_exit raise rand rand_r random random_r rawmemchr re_syntax_options read readdir readdir_r
readlink readlinkat readv realloc reallocarray realpath recv recvfrom recvmsg regcomp regerror regex regexec
regfree remainder remainderf remainderl remove remque remquo remquof remquol rename renameat renameat2 revoke
rewind rewinddir rindex rint rintf rintl rmdir rootn round roundeven roundevenf roundevenl roundf roundl
rpmatch rsqrt sbrk scalb scalbf scalbl scalbln scalblnf scalblnl scalbn scalbnf scalbnl scandir scanf sched
sched_get_priority_max sched_get_priority_min sched_getparam sched_getscheduler sched_rr_get_interval
sched_setparam sched_setscheduler sched_yield search secure_getenv seed48 seed48_r seekdir select sem_close
sem_destroy sem_getvalue sem_init sem_open sem_post sem_timedwait sem_trywait sem_unlink sem_wait semaphore
semctl semget semop send sendmsg sendto setbuf setbuffer setdomainname setegid setenv seteuid setgid setgrent
sethostent sethostid sethostname setitimer setjmp setlinebuf setlocale setlogin setlogmask setnetent
setpayload setpayloadf setpayloadl setpayloadsig setpayloadsigf setpayloadsigl setpgid setpgrp setpriority
setprotoent setpwent setregid setresgid setresuid setreuid setrlimit setservent setsid setsockopt setstate
setstate_r setuid setusershell setutxent setvbuf shm_open shm_unlink shmat shmctl shmdt shmget shutdown
sigabbrev_np sigaction sigaddset sigaltstack sigandset sigblock sigdelset sigdescr_np sigemptyset sigfillset
siggetmask sighold sigignore siginterrupt sigisemptyset sigismember siglongjmp signal signbit signgam
significand significandf significandl sigorset sigpause sigpending sigprocmask sigqueue sigrelse sigreturn
sigset sigsetmask sigstack sigsuspend sigtimedwait sigwait sigwaitinfo sin sincos sincosf sincosl sinf sinh
sinhf sinhl sinl sinpi sleep snprintf sockatmark socket socketpair spawn sprintf sqrt sqrtf sqrtl srand
srand48 srand48_r srandom srandom_r sscanf ssignal stat statvfs stdalign stdarg stdatomic stdbit stdbool
stdckdint stddef stderr stdin stdint stdio stdlib stdnoreturn stdout stpcpy stpncpy strcasecmp strcasecmp_l
strcasestr strcat strchr strchrnul strcmp strcoll strcoll_l strcpy strcspn strdup strerror strerror_l
strerror_r strerrordesc_np strerrorname_np strfmon strfmon_l strfromd strfromf strfroml strfry strftime
strftime_l string strings strlcat strlcpy strlen strncasecmp strncasecmp_l strncat strncmp strncpy strndup
strnlen stropts strpbrk strptime strptime_l strrchr strsep strsignal strspn strstr strtod strtod_l strtof
strtof128_l strtof32_l strtof64_l strtof_l strtoimax strtok strtok_r strtol strtol_l strtold strtold_l strtoll
strtoll_l strtoq strtoul strtoul_l strtoull strtoull_l strtoumax strtouq strverscmp strxfrm strxfrm_l swab
swprintf swscanf symlink symlinkat sync syncfs syscall sysconf sysexits syslog system sysv_signal tan tanf
tanh tanhf tanhl tanl tanpi tar tcdrain tcflow tcflush tcgetattr tcgetpgrp tcgetsid tcsendbreak tcsetattr
tcsetpgrp tdelete telldir tempnam termio termios tfind tgamma tgammaf tgammal tgkill tgmath thrd_create
thrd_current thrd_detach thrd_equal thrd_exit thrd_join thrd_sleep thrd_yield threads time timegm timelocal
timer_create timer_delete timer_getoverrun timer_gettime timer_settime times timespec_get timespec_getres
timezone tmpfile tmpfile64 tmpnam tmpnam_r toascii tolower tolower_l totalorder totalorderf totalorderl
totalordermag totalordermagf totalordermagl toupper toupper_l towctrans towctrans_l towlower towlower_l
towupper towupper_l trunc truncate truncate64 truncf truncl tsearch tss_create tss_delete tss_get tss_set
ttyname ttyname_r ttyslot twalk tzname tzset ualarm uchar ufromfp ufromfpf ufromfpl ufromfpx ufromfpxf
ufromfpxl ulimit umask uname ungetc ungetwc unistd unix unlink unlinkat unlockpt unsetenv uselocale usleep
utime utimensat utimes utmpx utoa va_arg va_copy va_end va_start valloc values vasprintf vdprintf vfork
vfprintf vfscanf vfwprintf vfwscanf vhangup vprintf vscanf vsnprintf vsprintf vsscanf vswprintf vswscanf
vwprintf vwscanf wait waitid waitpid wchar wcpcpy wcpncpy wcrtomb wcscasecmp wcscasecmp_l wcscat wcschr
wcschrnul wcscmp wcscoll wcscoll_l wcscpy wcscspn wcsdup wcsftime wcsftime_l wcslen wcsncasecmp wcsncasecmp_l
wcsncat wcsncmp wcsncpy wcsnlen wcsnrtombs wcspbrk wcsrchr wcsrtombs wcsspn wcsstr wcstod wcstod_l wcstof
wcstof128_l wcstof32_l wcstof64_l wcstof_l wcstoimax wcstok wcstol wcstol_l wcstold wcstold_l wcstoll
wcstoll_l wcstombs wcstoq wcstoul wcstoul_l wcstoull wcstoull_l wcstoumax wcstouq wcswcs wcswidth wcsxfrm
wcsxfrm_l wctob wctomb wctrans wctrans_l wctype wctype_l wcwidth windows wmemchr wmemcmp wmemcpy wmemmove
wmempcpy wmemset wordexp wordfree wprintf write writev wscanf y0 y0f y0l y1 y1f y1l yn ynf ynl
"""
LIBRARY = frozenset(_LIBRARY_TEXT.split())
